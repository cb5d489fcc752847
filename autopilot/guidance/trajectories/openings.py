"""Balls and windows to fly through, in place of points."""

from dataclasses import dataclass

import numpy as np

from colibri.common.types import Array

_INSIDE = 0.999  # at the edge itself the slope of a variable vanishes


@dataclass(frozen=True, slots=True)
class Openings:
    """What each waypoint is widened to: all that `centres + axes · q` reaches for q in a unit ball, or a unit box."""

    centres_enu_m: Array  # (n, 3)
    axes_m: Array  # half axes in columns, ENU, (n, 3, 3); 0 where a point is kept
    together: Array  # 1 for a ball, (3, 3); the identity for a box

    def points(self, u: Array) -> Array:
        """Return points, ENU, (n, 3), of unbounded variables, (n, 3)."""
        points: Array = self.centres_enu_m + _applied(self.axes_m, 2.0 * u / self._spread(u))
        return points

    def variables(self, points: Array) -> Array:
        """Return the variables, (n, 3), of points inside."""
        length = np.maximum((self.axes_m * self.axes_m).sum(axis=1), 1e-12)
        q = _INSIDE * _applied(np.swapaxes(self.axes_m, 1, 2), points - self.centres_enu_m) / length
        variables: Array = q / (1.0 + np.sqrt(np.maximum(1.0 - _applied(self.together, q * q), 0.0)))
        return variables

    def slopes(self, u: Array, of_points: Array) -> Array:
        """Return the slopes with the variables, (n, 3), from those with the points."""
        spread, pull = self._spread(u), _applied(np.swapaxes(self.axes_m, 1, 2), of_points)
        slopes: Array = 2.0 * pull / spread - 4.0 * u * _applied(self.together, pull * u / (spread * spread))
        return slopes

    def _spread(self, u: Array) -> Array:
        return 1.0 + _applied(self.together, u * u)


def _applied(matrices: Array, vectors: Array) -> Array:
    applied: Array = (matrices * vectors[:, None]).sum(axis=-1)
    return applied
