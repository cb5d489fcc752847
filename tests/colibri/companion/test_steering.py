from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.jit import packed
from colibri.common.types import Array
from colibri.companion.identification import RateLog, fit
from colibri.companion.stack import PX4, CompanionError, Response, read_response, response_text
from colibri.companion.steering import predictor as model
from colibri.companion.steering.law_pilot import turning_no_faster
from colibri.companion.steering.references import OVER_S, duration_s, smoothly_started, step_at
from colibri.plant.vehicle.description import load_vehicle

HUMMINGBIRD = load_vehicle("hummingbird")
RESPONSE = Response((0.03, 0.05, 0.2), 0.01, 0.02, (9.0, 9.0, 9.0), (999.0, 999.0, 999.0))
NOTHING = np.zeros(6)


def at_hover() -> Array:
    return np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.1, -0.2, 0.3, 9.81])


def test_a_hovering_vehicle_stays() -> None:
    y = at_hover()
    y[model.RATE] = 0.0
    numbers = packed(model.response_model(HUMMINGBIRD, RESPONSE))
    after = model.carry(y, np.array([0.5]), np.array([[0.0, 0.0, 0.0, 9.81]]), NOTHING, numbers)
    assert after == pytest.approx(y, abs=1e-9)


def test_the_commanded_rate_reaches_the_next_one_exactly() -> None:
    wanted, y = (0.3, -0.1, 0.2), at_hover()
    command = model.rate_command(tuple(y[model.RATE].tolist()), wanted, 0.008, RESPONSE)
    numbers = packed(model.response_model(HUMMINGBIRD, RESPONSE))
    after = model.carry(y, np.array([0.008]), np.array([[*command, 9.81]]), NOTHING, numbers)
    assert after[model.RATE] == pytest.approx(wanted)


def test_commands_stay_within_the_limits_of_the_stack() -> None:
    assert model.rate_command((0.0, 0.0, 0.0), (5.0, -5.0, 1.0), 0.008, RESPONSE) == (9.0, -9.0, 9.0)


def test_a_free_fall_is_one() -> None:
    y, numbers = at_hover(), packed(model.response_model(HUMMINGBIRD.without(["drag"]), RESPONSE))
    y[model.RATE], y[model.LIFT] = 0.0, 0.0
    after = model.carry(y, np.array([0.4]), np.zeros((1, 4)), NOTHING, numbers)
    assert after[2] == pytest.approx(5.0 - 0.5 * 9.81 * 0.16)
    assert after[5] == pytest.approx(-9.81 * 0.4)


def logged(lags_s: tuple[float, float, float], late_s: float, noise: float) -> RateLog:
    t = np.arange(0.0, duration_s(), 0.008)
    commands = np.array([step_at(float(time_s)) for time_s in t])
    measured_s, rates, rate = np.arange(0.0, duration_s(), 0.01), [], np.zeros(3)
    stays = np.exp(-0.01 / np.array(lags_s))
    for time_s in measured_s:
        at = max(int(np.searchsorted(t, time_s - 0.01 - late_s, side="right")) - 1, 0)
        rate = commands[at] + (rate - commands[at]) * stays
        rates.append(rate)
    trembling = noise * np.random.default_rng(1).normal(size=(len(rates), 3))
    return RateLog(t, commands, measured_s, np.array(rates) + trembling)


def test_a_fit_finds_the_lag_that_there_is() -> None:
    found = fit(logged((0.03, 0.06, 0.15), 0.02, 0.01))
    assert found.time_constant_s == pytest.approx([0.03, 0.06, 0.15], rel=0.12)
    assert found.latency_s == pytest.approx(0.02, abs=0.008)
    assert found.explained.min() > 0.95
    assert found.order == 1


@pytest.mark.long
def test_a_fit_finds_a_second_order_lag_and_delay() -> None:
    t, late, rows = np.arange(0.0, duration_s(), 0.008), 60, []
    commands, rate, turning = np.array([step_at(float(time_s)) for time_s in t]), np.zeros(3), np.zeros(3)
    times, lags, behind = np.arange(0.0, duration_s(), 0.001), np.array([0.07, 0.06, 0.3]), np.array([0.04, 0.03, 0.08])
    for n, _ in enumerate(times):
        wanted = commands[max(n - late, 0) // 8]
        turning = turning + 0.001 * ((wanted - rate) / lags - turning) / behind
        rate = rate + 0.001 * turning
        rows.append(rate)
    trembling = 0.05 * np.random.default_rng(3).normal(size=(len(rows[::8]), 3))
    found = fit(RateLog(t, commands, times[::8], np.array(rows[::8]) + trembling))
    assert found.order == 2
    assert found.time_constant_s == pytest.approx(lags, rel=0.1)
    assert found.acceleration_lag_s == pytest.approx(behind, rel=0.2)
    assert found.latency_s == pytest.approx(0.06, abs=0.006)


def test_noise_alone_is_no_response() -> None:
    log = logged((0.03, 0.06, 0.15), 0.02, 0.0)
    noise = np.random.default_rng(2).normal(size=log.rates.shape)
    with pytest.raises(CompanionError, match="less than 50"):
        fit(log._replace(rates=noise))
    with pytest.raises(CompanionError, match="only 3 states"):
        fit(log._replace(measured_s=log.measured_s[:3], rates=log.rates[:3]))


def test_steps_are_small_and_about_one_axis_at_a_time() -> None:
    steps = np.array([step_at(0.01 * n) for n in range(round(100 * duration_s()))])
    assert np.abs(steps).max() <= 0.6
    assert ((steps != 0.0).sum(axis=1) <= 1).all()
    assert 0.01 * np.abs(steps.sum(axis=0)).max() < 0.03
    assert (steps != 0.0).any(axis=0).all()


def test_a_response_is_read_back_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "companion.toml"
    file.write_text(response_text(RESPONSE, 1.1, ["found"]), encoding="utf-8")
    assert read_response(file) == (RESPONSE, 1.1)
    file.write_text("latency_s = 0.1\n", encoding="utf-8")
    with pytest.raises(CompanionError, match="time_constant_s"):
        read_response(file)
    with pytest.raises(CompanionError, match="No such file"):
        read_response(tmp_path / "none.toml")


@pytest.mark.parametrize("name", ["spiral", "lemniscate:lap=8"])
def test_a_track_begins_at_rest_and_goes_on_as_it_is(name: str) -> None:
    as_it_is = track(name)
    started = smoothly_started(as_it_is)
    first = np.array([0.0, 1e-3])
    for derivative in range(1, 4):
        assert position(started, first, derivative) == pytest.approx(0.0, abs=1e-3)
    later = np.array([OVER_S, OVER_S + 3.0])
    for derivative in range(4):
        shifted = position(as_it_is, later - 0.5 * OVER_S, derivative)
        assert position(started, later, derivative) == pytest.approx(shifted, abs=1e-6)
    assert position(started, np.array([0.0])) == pytest.approx(position(as_it_is, np.array([0.0])))


def test_a_slower_attitude_loop_becomes_inertia() -> None:
    slow = replace(PX4.response, max_acceleration_rad_s2=(10.0, 12.0, 6.0))
    ix, iy, iz = turning_no_faster(load_vehicle("iris"), slow).body.inertia_kg_m2
    before = load_vehicle("iris").body.inertia_kg_m2
    assert min(ix / before[0], iy / before[1]) > 1.0
    assert 2.0 * max(ix, iy, iz) <= ix + iy + iz
