"""The speed along the path: references at path times, what a speed changes, flights that keep the time or the path."""

import numpy as np
import pytest

from colibri.autopilot.control.interface import Horizon, Preview
from colibri.autopilot.control.lpv_mpc import path, solution
from colibri.autopilot.control.lpv_mpc.deviations import DEVIATIONS, POSITION, VELOCITY
from colibri.autopilot.control.lpv_mpc.law import LpvMpc
from colibri.autopilot.control.lpv_mpc.path import PathLimits, PathNow
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.qp import Qp, QpSolver
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.config import SettingsError
from colibri.common.types import Array
from colibri.plant.physics.start import Start
from tests.support.lpv_mpc import ROTORS, TABLE, VEHICLE, Flight

INTERVAL_S = 0.008
STARTS = np.array([0, 2, 6, 20])
SAMPLES = int(STARTS[-1]) + 2
EFFECTS = path.speed_effects(STARTS, INTERVAL_S)
SPEEDS = np.array([1.0, 0.8, 0.5])
ON_PATH = load_profile("path").table("lpv-mpc")


def horizon() -> Horizon:
    return Planner(track("lemniscate:lap=5"), "by-formula", Preview(8_000, 2 * SAMPLES)).horizon(0)


def slid(references: Horizon, speeds: Array, from_s: float = 0.0) -> tuple[tuple[Array, ...], Array, float]:
    n = len(speeds)
    out, slopes = (np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty(n)), np.empty((n, 6))
    return out, slopes, path.slide(references, from_s, speeds, INTERVAL_S, out, slopes)


def speeds_of(at_ends: Array, first: float = 0.9) -> Array:
    """σ at each sample, from `first` now to those at the ends of blocks."""
    speeds: Array = np.interp(np.arange(SAMPLES), STARTS, [first, *at_ends])
    return speeds


@pytest.mark.parametrize("speed", [1.0, 0.73, 1.05])
def test_references_at_a_steady_speed_are_those_of_path_time(speed: float) -> None:
    (p, v, a, yaw), slopes, passed_s = slid(horizon(), np.full(SAMPLES, speed), from_s=0.003)
    times_s = 0.003 + speed * INTERVAL_S * np.arange(SAMPLES)
    assert passed_s == pytest.approx(times_s[-1])
    assert np.abs(p - position(track("lemniscate:lap=5"), np.asarray(times_s, np.float64))).max() < 1e-8
    assert v == pytest.approx(speed * slopes[:, :3])
    assert a == pytest.approx(speed * speed * slopes[:, 3:])
    assert yaw == pytest.approx(np.arctan2(v[:, 1], v[:, 0]), abs=1e-6)


def test_path_speeds_are_carried_over_within_their_bounds() -> None:
    speeds, last = np.empty(SAMPLES), np.linspace(1.0, 0.2, 12)
    path.carry_speeds(last, STARTS, 0.3, 0.9, speeds)
    assert speeds[STARTS].tolist() == pytest.approx([1.0, last[2], last[6], 0.3])
    assert speeds == pytest.approx(np.interp(np.arange(SAMPLES), STARTS, speeds[STARTS]))


def test_speed_effects_are_derivatives_of_the_deviation() -> None:
    references, nominal = horizon(), speeds_of(SPEEDS)
    (p, v, _, _), slopes, _ = slid(references, nominal)
    responses = np.zeros((SAMPLES - 1, DEVIATIONS, (ROTORS + 1) * len(SPEEDS)))
    path.fill_slides(PathNow(nominal, slopes, 1.0, PathLimits(0.1, 1.0, 60.0, 1.0)), EFFECTS, responses)
    for block, by in enumerate(1e-5 * np.eye(len(SPEEDS))):
        (moved, faster, _, _), _, _ = slid(references, speeds_of(SPEEDS + by))
        column = responses[:, :, (ROTORS + 1) * block + ROTORS]
        assert column[:, POSITION : POSITION + 3] == pytest.approx((p - moved)[:-1] / 1e-5, abs=1e-5)
        assert column[:, VELOCITY : VELOCITY + 3] == pytest.approx((v - faster)[:-1] / 1e-5, abs=1e-3)


@pytest.mark.parametrize("reward", [100.0, -100.0])
def test_a_minimum_with_speeds_at_their_bounds_can_be_free(reward: float) -> None:
    rng = np.random.default_rng(1)
    root, n = rng.normal(size=(10, 10)), 10
    lower, upper = np.full(n, -20.0), np.full(n, 20.0)
    f = rng.normal(size=n)
    f[ROTORS :: ROTORS + 1] -= reward
    lower[ROTORS :: ROTORS + 1], upper[ROTORS :: ROTORS + 1] = -0.5, 0.1
    qp, z = Qp(root @ root.T + np.eye(n), f, np.zeros((0, n)), np.zeros(0), lower, upper), np.empty(n)
    assert solution.free_minimum(qp, 2, ROTORS, z) is (reward > 0.0)
    solved = QpSolver("daqp", 1e-10).solve(qp).x
    assert solved is not None
    assert np.allclose(z, solved, atol=1e-8) is (reward > 0.0)


def on_path(lap_s: float, seconds: float) -> tuple[Flight, Array]:
    """Fly a lemniscate from rest at its middle, on the path; return the flight and distances from the path, m."""
    flight = Flight(Start(x=0.0, y=0.0, z=20.0, psi=45.0, rotors=4740.0))
    flight.law = LpvMpc(ON_PATH, VEHICLE, lambda: 0.0)
    flight.memory = flight.law.initial(VEHICLE.hover_speed)
    name = f"lemniscate:lap={lap_s},height=20"
    planner = Planner(track(name), "by-formula", flight.law.preview)
    curve, distances = position(track(name), np.linspace(0.0, lap_s, 20_000)), []
    for _ in range(round(seconds / INTERVAL_S)):
        now_us = flight.world.time_us
        references = planner.horizon_at(now_us - flight.law.lag_us(flight.memory), 8_000)
        flight.take(*flight.law.step_on_path(flight.memory, now_us, flight.state(), references))
        distances.append(np.linalg.norm(curve - np.array(flight.state().position_enu_m), axis=1).min())
    return flight, np.array(distances)


def test_what_cannot_keep_the_time_stays_on_the_path() -> None:
    flight, distances_m = on_path(3.0, 6.0)
    lag_s = flight.law.lag_us(flight.memory) * 1e-6
    assert 0.5 < lag_s < 4.0
    assert distances_m[250:].max() < 0.1
    assert all(decision.diagnostics.fallback is None for decision in flight.decisions)
    assert flight.decisions[-1].diagnostics.path_lag_s == pytest.approx(lag_s, abs=0.01)


def test_what_can_keep_the_time_catches_up_with_it() -> None:
    flight, _ = on_path(8.0, 2.0)
    after_start_us = flight.law.lag_us(flight.memory)
    assert after_start_us > 0
    later, distances_m = on_path(8.0, 6.0)
    assert later.law.lag_us(later.memory) < 0.5 * after_start_us
    assert distances_m[500:].max() < 0.01


def test_a_speed_that_is_none_is_refused() -> None:
    with pytest.raises(SettingsError, match="min_speed"):
        LpvMpc({**TABLE, "path": {**TABLE["path"], "min_speed": 0.0}}, VEHICLE, lambda: 0.0)
