import numpy as np
import pytest
from msgspec.structs import replace
from scipy.linalg import expm

from colibri.common.jit import packed
from colibri.companion.stack import Response
from colibri.companion.steering import predictor as model
from colibri.companion.steering.predictor import Predictor
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import load_vehicle

HUMMINGBIRD = load_vehicle("hummingbird").without(["drag"])
FIRST = Response((0.03, 0.05, 0.2), 0.01, 0.0, (9.0, 9.0, 9.0), (999.0, 999.0, 999.0))
SECOND = replace(FIRST, time_constant_s=(0.07, 0.05, 0.3), acceleration_lag_s=(0.04, 0.03, 0.1))
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


def hovering(at_us: int, x: float, vx: float, rate: tuple[float, float, float] = STILL) -> StateFrame:
    return StateFrame(at_us, (x, 0.0, 2.0), (vx, 0.0, 0.0), LEVEL, rate)


def test_position_and_velocity_are_predicted_consistently() -> None:
    predictor, drift_m_s = Predictor(HUMMINGBIRD, FIRST), 0.3
    for n in range(250):
        predictor.observe(8000 * n, hovering(8000 * n, 0.1 + 0.008 * n * (0.5 + drift_m_s), 0.5))
    y = predictor.at(8000 * 249 + 100_000)
    assert y[0] == pytest.approx(0.1 + (0.008 * 249 + 0.1) * 0.8, abs=2e-3)
    assert y[3] == pytest.approx(0.5 + drift_m_s, abs=5e-3)
    assert predictor.disturbance == pytest.approx(np.zeros(6), abs=1e-6)


def test_an_estimate_without_drift_is_predicted_as_it_is() -> None:
    predictor = Predictor(HUMMINGBIRD, FIRST)
    for n in range(50):
        predictor.observe(8000 * n, hovering(8000 * n, 0.004 * n, 0.5))
    assert predictor.drift_m_s == pytest.approx(np.zeros(3), abs=1e-9)


def test_second_order_rates_solve_the_differential_equation() -> None:
    y, commands = np.zeros(model.STATES), np.array([[1.0, -0.5, 0.3, 9.81]])
    y[6], y[model.LIFT] = 1.0, 9.81
    numbers = packed(model.response_model(HUMMINGBIRD, SECOND))
    after = model.carry(y, np.array([0.1]), commands, np.zeros(6), numbers)
    for axis, (lag_s, behind_s) in enumerate(zip(SECOND.time_constant_s, SECOND.acceleration_lag_s, strict=True)):
        wanted = commands[0, axis]

        matrix = np.array([[0.0, 1.0, 0.0], [-1.0 / (lag_s * behind_s), -1.0 / behind_s, wanted / (lag_s * behind_s)]])
        exact = expm(0.1 * np.vstack((matrix, np.zeros(3))))[:2, 2]
        assert after[10 + axis] == pytest.approx(exact[0], rel=0.01)
        assert after[14 + axis] == pytest.approx(exact[1], rel=0.01, abs=0.03)


def test_noisy_second_order_rates_are_smoothed() -> None:
    predictor, random = Predictor(HUMMINGBIRD, SECOND), np.random.default_rng(1)
    predicted = []
    for n in range(500):
        p, q, _ = 0.1 * random.normal(size=3)
        predictor.observe(8000 * n, hovering(8000 * n, 0.0, 0.0, (p, q, 0.0)))
        predicted.append(predictor.at(8000 * n)[model.RATE][:2])
    assert np.std(predicted[100:]) < 0.04


def test_a_command_gives_its_acceleration_after_the_lag() -> None:
    wanted_rad_s2, interval_s, y = 4.0, 0.008, np.zeros(model.STATES)
    y[6], y[model.LIFT] = 1.0, 9.81
    numbers = packed(model.response_model(HUMMINGBIRD, SECOND))
    for _ in range(50):
        p = float(y[10])
        c, _, _ = model.rate_command((p, 0.0, 0.0), (p + wanted_rad_s2 * interval_s, 0.0, 0.0), interval_s, SECOND)
        y = model.carry(y, np.array([interval_s]), np.array([[c, 0.0, 0.0, 9.81]]), np.zeros(6), numbers)
    assert y[model.ACCELERATION][0] == pytest.approx(wanted_rad_s2, rel=0.15)
