"""Closed curves flown at a speed that grows from rest and falls back: the tracks of SSI-MPC (arXiv 2407.04143).

With arc length s = r |A| of the angle A, s'' follows this shape times the acceleration, for 2 v / a + 4 s in all:
sin²(π t / 4) for 2 s; 1; cos(π t / 4) for 4 s; -1; sin²(π t / 4) - 1 for 2 s.
"""

from collections.abc import Callable, Mapping
from math import pi
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries, cos, held, sin
from colibri.common.types import Array

Curve: TypeAlias = Literal["circle", "tilted-circle", "lemniscate", "wrapped-circle", "wrapped-lemniscate"]

_RATE = pi / 4.0  # rad/s
_EDGE_S, _TURN_S = 2.0, 4.0
_PHASES = np.array([[0.5, 0.0, -0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-0.5, 0.0, -0.5]])
"""Each as factors of 1, cos(π t / 4) and cos(π t / 2)."""


class Shape(NamedTuple):
    """A curve by its angle: radius, m, then x and y in parts of it, and the height, m."""

    radius_m: float
    across: Callable[[TaylorSeries], tuple[TaylorSeries, TaylorSeries]]
    height: Callable[[TaylorSeries], TaylorSeries]


def _circle(angle: TaylorSeries) -> tuple[TaylorSeries, TaylorSeries]:
    return sin(angle), cos(angle)


def _lemniscate(angle: TaylorSeries) -> tuple[TaylorSeries, TaylorSeries]:
    return cos(angle), sin(angle) * cos(angle)


def _level(angle: TaylorSeries) -> TaylorSeries:
    return held(angle, 2.5)


SHAPES: Mapping[Curve, Shape] = {
    "circle": Shape(5.0, _circle, _level),
    "tilted-circle": Shape(5.0, _circle, lambda angle: 2.5 - 0.5 * cos(angle)),
    "lemniscate": Shape(7.5, _lemniscate, _level),
    "wrapped-circle": Shape(4.5, _circle, lambda angle: 3.0 - 1.5 * cos(1.5 * angle)),
    "wrapped-lemniscate": Shape(7.5, _lemniscate, lambda angle: 3.0 - 1.5 * cos(4.0 * angle)),
}


def duration_s(speed: float, acceleration: float) -> float:
    return 2.0 * speed / acceleration + _EDGE_S + 0.5 * _TURN_S


def arc(t: TaylorSeries, speed: float, acceleration: float) -> TaylorSeries:
    """Return the arc length, m, at times from 0; the speed must be at least 2 s of the acceleration."""
    steady_s = speed / acceleration - _EDGE_S
    lasts = (_EDGE_S, steady_s, _TURN_S, steady_s, _EDGE_S)
    begins, arrived = [0.0], [np.zeros(2)]
    for last_s, phase in zip(lasts, _PHASES, strict=True):
        end = _phase(TaylorSeries.time(np.array([last_s]), 1), phase, arrived[-1])
        arrived.append(end.coefficients[:, 0])
        begins.append(begins[-1] + last_s)
    at = np.clip(np.searchsorted(begins, t.coefficients[0], side="right") - 1, 0, len(lasts) - 1)
    return _phase(t - np.array(begins)[at], _PHASES[at].T, np.array(arrived)[at].T) * acceleration


def _phase(x: TaylorSeries, factors: Array, arrived: Array) -> TaylorSeries:
    """Integrate a phase twice, from the arc and speed at which its predecessor arrived."""
    one, slow, fast = factors
    square = _RATE * _RATE
    bends = (1.0 - cos(_RATE * x)) * (slow / square) + (1.0 - cos(2.0 * _RATE * x)) * (fast / (4.0 * square))
    arc_m: TaylorSeries = x * x * (0.5 * one) + x * arrived[1] + arrived[0] + bends
    return arc_m
