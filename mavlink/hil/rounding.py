"""Rounding of a state frame as its datagram rounds it, as a compiled kernel."""

from math import isfinite, sqrt
from typing import TypeAlias

import numpy as np

from colibri.common.compiled_rotations import QUATERNION, VECTOR
from colibri.common.jit import compiled, compiled_for
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.state import UNIT_NORM_TOLERANCE, StateFrame
from colibri.mavlink.wire import ned

_Motion: TypeAlias = tuple[Vector, Vector, Quaternion, Vector]
_MOTION = f"{VECTOR}, {VECTOR}, {QUATERNION}, {VECTOR}"

_turned = compiled(ned.ned_frd_from_enu_flu)


def state_as_received(frame: StateFrame) -> StateFrame | None:
    """Return the frame as rounded by `encode_state` and `read_state`."""
    time_us = frame.time_us - frame.time_us % 1000
    is_valid, motion = _rounded(frame.position_enu_m, frame.velocity_enu_m_s, frame.attitude, frame.rate_flu_rad_s)
    return StateFrame(time_us, *motion) if is_valid else None


@compiled
def _single(x: float) -> float:
    return np.float64(np.float32(x))


@compiled
def _singles(vector: Vector) -> Vector:
    return _single(vector[0]), _single(vector[1]), _single(vector[2])


@compiled_for(f"Tuple((boolean, Tuple(({_MOTION}))))({_MOTION})")
def _rounded(position: Vector, velocity: Vector, attitude: Quaternion, rate: Vector) -> tuple[bool, _Motion]:
    """Return whether the numbers are valid, and the numbers; the operations are those of `state`."""
    p, v, w = _singles(position), _singles(velocity), _singles(rate)
    turned = _turned(attitude)
    q1, q2, q3, q4 = _single(turned[0]), _single(turned[1]), _single(turned[2]), _single(turned[3])
    squared = q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4
    norm = sqrt(squared)
    is_finite = isfinite(p[0] + p[1] + p[2] + v[0] + v[1] + v[2] + w[0] + w[1] + w[2])
    unit = _turned((q1 / norm, q2 / norm, q3 / norm, q4 / norm))
    return abs(squared - 1.0) < UNIT_NORM_TOLERANCE and is_finite, (p, v, unit, w)
