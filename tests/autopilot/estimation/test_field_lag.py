"""A late magnetic field is told from a bias of the gyroscope."""

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest

from colibri.autopilot.estimation.sensing.field_lag import FieldLag
from colibri.common.types import Vector

INTERVAL_US, FIELD_GAUSS, NOISE_GAUSS = 4_000, 0.5, 0.005


def swings(t: float) -> float:
    return 0.15 * sin(2.0 * pi * 0.8 * t) + 0.1 * sin(2.0 * pi * 2.1 * t)


def turns(t: float) -> float:
    return 0.6 * t


def rests(_t: float) -> float:
    return 0.0


@pytest.mark.parametrize(
    ("flies", "late_s", "lead_rad", "found"),
    [
        (swings, 0.1, 0.0, True),
        (swings, 0.2, 0.0, True),
        (swings, 0.4, 0.0, True),
        (swings, 0.0, 0.0, False),
        (swings, 0.0, 0.1, False),
        (turns, 0.0, 0.1, False),
        (rests, 0.2, 0.1, False),
    ],
)
def test_only_a_field_that_comes_late_is_late(
    flies: Callable[[float], float], late_s: float, lead_rad: float, found: bool
) -> None:
    seen = verdicts(flies, lambda _: late_s, lead_rad)
    assert seen[-1] is found
    assert any(seen) is found


def test_a_field_that_is_on_time_again_is_not_late() -> None:
    seen = verdicts(swings, lambda t: 0.2 if t < 3.0 else 0.0)
    assert seen[len(seen) // 2]
    assert not seen[-1]


@pytest.mark.parametrize(("late_s", "convicted"), [(0.2, True), (0.0, False)])
def test_a_suspect_field_is_convicted_instead_of_the_gyroscope(late_s: float, convicted: bool) -> None:
    lag = FieldLag(NOISE_GAUSS**2)
    for sample in range(360):
        t = sample * INTERVAL_US * 1e-6
        lag.add(field(swings(t - late_s)), field(swings(t)), sample * INTERVAL_US)
        if lag.late:
            break
    assert lag.convict((sample + 100) * INTERVAL_US) is convicted


def verdicts(flies: Callable[[float], float], late_s: Callable[[float], float], lead_rad: float = 0.0) -> list[bool]:
    lag, noise, seen = FieldLag(NOISE_GAUSS**2), np.random.default_rng(1), []
    for sample in range(2000):
        t = sample * INTERVAL_US * 1e-6
        x, y, z = (np.array(field(flies(t - late_s(t)))) + noise.normal(0.0, NOISE_GAUSS, 3)).tolist()
        lag.add((x, y, z), field(flies(t) + lead_rad), sample * INTERVAL_US)
        seen.append(lag.late)
    return seen


def field(angle_rad: float) -> Vector:
    return (FIELD_GAUSS * cos(angle_rad), -FIELD_GAUSS * sin(angle_rad), 0.0)
