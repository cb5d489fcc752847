"""Hypothesis strategies and tolerances that several tests share."""

from math import pi

from hypothesis import strategies as st

from colibri.common.rotations import normalized
from colibri.common.types import Quaternion, Vector


def reals(limit: float) -> st.SearchStrategy[float]:
    return st.floats(-limit, limit, allow_nan=False)


def vectors(limit: float = 1e3) -> st.SearchStrategy[Vector]:
    return st.tuples(reals(limit), reals(limit), reals(limit))


def quaternions() -> st.SearchStrategy[Quaternion]:
    components = st.tuples(reals(1.0), reals(1.0), reals(1.0), reals(1.0))
    return components.filter(lambda q: sum(c * c for c in q) > 1e-3).map(normalized)


ANGLES = reals(pi)
TILTS = reals(0.49 * pi)
