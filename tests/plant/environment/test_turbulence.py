"""Dryden's turbulence against the formulas of MIL-F-8785C."""

from collections.abc import Callable
from functools import cache
from math import pi

import numpy as np
import pytest
from scipy.signal import welch

from colibri.common.types import Array
from colibri.plant.environment.turbulence import W20_KNOTS, Air, Turbulence, add_eddies, scales, step
from colibri.plant.environment.weather import Intensity, Weather
from colibri.plant.texts import wind

FOOT = 0.3048
KNOT = 1852.0 / 3600.0
AIRSPEED_M_S, HEIGHT_M = 10.0, 30.0
SCALE = scales(W20_KNOTS["moderate"], HEIGHT_M)


@cache
def blow(steps: int, step_s: float, seed: int = 1) -> Array:
    turbulence = Turbulence(seed)
    begun, lags = turbulence.begin()
    velocities = []
    for frame in range(begun, begun + steps):
        velocities.append(add_eddies((0.0, 0.0, 0.0), lags, SCALE, 1.0, 0.0))
        lags = step(lags, turbulence.noise(frame), SCALE, AIRSPEED_M_S, step_s)
    return np.array(velocities)


def along(omega: Array, sigma: float, length_m: float) -> Array:
    spectrum: Array = sigma**2 * 2.0 * length_m / (pi * AIRSPEED_M_S) / (1.0 + (length_m * omega / AIRSPEED_M_S) ** 2)
    return spectrum


def across(omega: Array, sigma: float, length_m: float) -> Array:
    squared = (length_m * omega / AIRSPEED_M_S) ** 2
    spectrum: Array = sigma**2 * length_m / (pi * AIRSPEED_M_S) * (1.0 + 3.0 * squared) / (1.0 + squared) ** 2
    return spectrum


@pytest.mark.parametrize(("intensity", "knots"), [("light", 15.0), ("moderate", 30.0), ("severe", 45.0)])
def test_the_scales_are_those_of_the_specification(intensity: Intensity, knots: float) -> None:
    assert W20_KNOTS[intensity] == knots
    vertical = 0.1 * knots * KNOT
    assert scales(knots, 1000.0 * FOOT) == pytest.approx((vertical, vertical, 1000.0 * FOOT, 1000.0 * FOOT))
    slope = 0.177 + 0.000823 * 100.0
    low = (vertical / slope**0.4, vertical, 100.0 * FOOT / slope**1.2, 100.0 * FOOT)
    assert scales(knots, 100.0 * FOOT) == pytest.approx(low)


@pytest.mark.parametrize(("height_ft", "as_ft"), [(9.0, 10.0), (-5.0, 10.0), (1500.0, 1000.0)])
def test_below_ten_and_above_a_thousand_feet_it_is_as_there(height_ft: float, as_ft: float) -> None:
    assert scales(15.0, height_ft * FOOT) == pytest.approx(scales(15.0, as_ft * FOOT))


@pytest.mark.parametrize(("axis", "formula"), [(0, along), (1, across), (2, across)])
def test_the_spectrum_is_drydens(axis: int, formula: Callable[[Array, float, float], Array]) -> None:
    step_s = 0.02
    sigma_uv, sigma_w, length_uv, length_w = SCALE
    sigma, length = (sigma_w, length_w) if axis == 2 else (sigma_uv, length_uv)
    frequencies, measured = welch(blow(1 << 17, step_s)[:, axis], fs=1.0 / step_s, nperseg=4096)
    shown = (frequencies > 0.02) & (frequencies < 5.0)  # above, a sampled spectrum holds what lies beyond 25 Hz too
    wanted = 2.0 * pi * formula(2.0 * pi * frequencies[shown], sigma, length)
    bands = np.array_split(np.log(measured[shown] / wanted), 8)
    assert [float(np.mean(band)) for band in bands] == pytest.approx([0.0] * 8, abs=0.12)


def test_it_blows_from_the_first_frame_on() -> None:
    first = np.array([blow(1, 0.004, seed)[0] for seed in range(2000)])
    sigma_uv, sigma_w, _, _ = SCALE
    assert first.std(axis=0) == pytest.approx([sigma_uv, sigma_uv, sigma_w], rel=0.06)
    assert np.abs(np.corrcoef(first.T) - np.eye(3)).max() < 0.08


def test_turbulence_depends_on_airspeed_alone() -> None:
    standing, flying = (Air(Weather(wind(text), turbulence="light", seed=5)) for text in ("8@270", "0@0"))
    velocity_0, eddies_0 = standing.begin(HEIGHT_M)
    velocity_1, eddies_1 = flying.begin(HEIGHT_M)
    for frame in range(1, 100):
        velocity_0, eddies_0 = standing.go_on(eddies_0, 4000 * frame, HEIGHT_M, (0.0, 0.0, 0.0), 4000)
        velocity_1, eddies_1 = flying.go_on(eddies_1, 4000 * frame, HEIGHT_M, (-8.0, 0.0, 0.0), 4000)
        assert velocity_0 == pytest.approx(np.add(velocity_1, (8.0, 0.0, 0.0)))


def test_the_eddies_are_along_the_wind() -> None:
    east, north = (
        Air(Weather(wind(text), turbulence="light", seed=5)).begin(HEIGHT_M)[0] for text in ("8@270", "8@180")
    )
    assert north == pytest.approx((-east[1], east[0], east[2]))
