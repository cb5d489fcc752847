"""The functions of `elementary` for arrays of finite numbers, bit for bit."""

from math import pi

import numpy as np
from numpy.typing import NDArray

from colibri.common import elementary as one
from colibri.common.types import Array

_HEADS, _TAILS = np.array(one.ATAN).T.copy()


def sin(x: Array) -> Array:
    quarter, sine, cosine = _both(x)
    value = np.where(quarter & 1, cosine, sine)
    return np.where(quarter & 2, -value, value)


def cos(x: Array) -> Array:
    quarter, sine, cosine = _both(x)
    value = np.where(quarter & 1, sine, cosine)
    return np.where((quarter + 1) & 2, -value, value)


def atan2(y: Array, x: Array) -> Array:
    across, along = np.abs(y), np.abs(x)
    steep = across > along
    larger, smaller = np.where(steep, across, along), np.where(steep, along, across)
    slope = smaller / np.where(larger > 0.0, larger, 1.0)
    step = (slope * one.ATAN_STEPS + 0.5).astype(np.int64)
    angle = one.arctangent(slope, step / one.ATAN_STEPS, _HEADS[step], _TAILS[step])
    upwards = np.where(x > 0.0, one.HALF_PI - (angle - one.HALF_PI_TAIL), one.HALF_PI + (angle + one.HALF_PI_TAIL))
    behind = np.where(np.signbit(x), pi - (angle - 2.0 * one.HALF_PI_TAIL), angle)
    angles: Array = np.copysign(np.where(steep, upwards, behind), y)
    return angles


def exp(x: Array) -> Array:
    return np.array([one.exp(it) for it in x.tolist()])


def _both(x: Array) -> tuple[NDArray[np.int64], Array, Array]:
    x = np.where(np.abs(x) > one.MAX_RAD, x % (2.0 * pi), x)
    n: Array = np.floor(x * one.QUARTERS_PER_RAD + 0.5)
    head, tail = one.reduced(x, n)
    return n.astype(np.int64), one.sine(head, tail), one.cosine(head, tail)
