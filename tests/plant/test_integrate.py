"""The integrators: order, accuracy, and what they do with a state that explodes."""

from collections.abc import Sequence
from math import cos, exp, sin

import numpy as np
import pytest

from plant.integrate import RK4_STEP_S, IntegrationError, dormand_prince, runge_kutta_4, solver


def oscillator(x: Sequence[float]) -> list[float]:
    return [x[1], -25.0 * x[0]]


@pytest.mark.parametrize("name", ["rk4", "adaptive"])
def test_an_oscillator(name: str) -> None:
    integrate = solver("rk4" if name == "rk4" else "adaptive")
    assert integrate(oscillator, [1.0, 0.0], 0.5) == pytest.approx([cos(2.5), -5.0 * sin(2.5)], abs=1e-8)


def test_runge_kutta_is_of_fourth_order() -> None:
    def error(steps: int) -> float:
        h = 0.4 / steps
        rate = RK4_STEP_S / h  # time runs slower, so that one step of the rule is a step of h
        end = runge_kutta_4(lambda x: [-10.0 * x[0] / rate], [1.0], 0.4 * rate)
        return abs(end[0] - exp(-4.0))

    slope = np.polyfit(np.log([16, 32, 64]), np.log([error(16), error(32), error(64)]), 1)[0]
    assert slope == pytest.approx(-4.0, abs=0.2)


def test_a_state_that_explodes_is_an_error() -> None:
    with pytest.raises(IntegrationError, match="no step is small enough"):
        dormand_prince()(lambda x: [x[0] * x[0]], [1.0], 2.0)
