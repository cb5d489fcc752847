"""Consistency of an estimator's errors with its covariance: NEES and NIS against the bounds of χ².

Y. Bar-Shalom, X. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, section 5.4: over
independent flights, the sum of normalised errors squared is χ² of as many degrees of freedom as there are numbers.
"""

from typing import NamedTuple

import numpy as np

from colibri.common.types import Array

NAVIGATION = 9
"""Position, velocity, attitude."""


class Errors(NamedTuple):
    """True less estimated, at one instant, with the covariance that the filter gives it.

    Attributes:
        error: Position m ENU, velocity m/s ENU, attitude as a rotation vector in the estimated body frame, rad, (9,).
        covariance: (9, 9).
    """

    error: Array
    covariance: Array

    def nees(self, first: int = 0, count: int = NAVIGATION) -> float:
        """Return the normalised estimation error squared of a part."""
        part = slice(first, first + count)
        return float(self.error[part] @ np.linalg.solve(self.covariance[part, part], self.error[part]))


class Bounds(NamedTuple):
    """Between which the mean over independent flights lies."""

    lower: float
    upper: float

    def hold(self, mean: float) -> bool:
        """Whether a mean lies between them."""
        return self.lower <= mean <= self.upper


def bounds(numbers: int, flights: int, level: float = 0.95) -> Bounds:
    """Return where the mean of χ² of `numbers` degrees of freedom over `flights` lies, with probability `level`."""
    from scipy.special import chdtri  # slow to load, and scipy.stats, which has it too, slower: a report does without

    lower, upper = (float(chdtri(numbers * flights, above)) for above in (0.5 + 0.5 * level, 0.5 - 0.5 * level))
    return Bounds(lower / flights, upper / flights)
