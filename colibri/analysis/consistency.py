"""Consistency of an estimator's errors with its covariance: NEES and NIS against the bounds of χ².

Y. Bar-Shalom, X. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, section 5.4.
"""

from typing import NamedTuple

import numpy as np

from colibri.common.types import Array

NAVIGATION = 9
"""Position, velocity, attitude."""


class Errors(NamedTuple):
    """True minus estimated position, m, velocity, m/s, ENU, and attitude, rad, body, with covariance (9, 9)."""

    error: Array
    covariance: Array

    def nees(self, first: int = 0, count: int = NAVIGATION) -> float:
        """Return the normalised estimation error squared of a part."""
        part = slice(first, first + count)
        return float(self.error[part] @ np.linalg.solve(self.covariance[part, part], self.error[part]))


def bounds(numbers: int, flights: int, level: float = 0.95) -> tuple[float, float]:
    """Return bounds of the mean of χ² with `numbers` degrees of freedom over `flights`."""
    from scipy.special import chdtri  # slow to load, and scipy.stats, which has it too, slower: a report does without

    lower, upper = (float(chdtri(numbers * flights, above)) for above in (0.5 + 0.5 * level, 0.5 - 0.5 * level))
    return lower / flights, upper / flights
