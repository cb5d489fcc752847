"""Two ways to integrate x' = f(x) over a frame: fixed-step Runge-Kutta 4, and adaptive Dormand-Prince 4(5)."""

from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

Derivative: TypeAlias = Callable[[Sequence[float]], list[float]]
Integrator: TypeAlias = Literal["rk4", "adaptive"]

RK4_STEP_S = 0.001
RELATIVE_TOLERANCE = 1e-10
ABSOLUTE_TOLERANCE = 1e-12


class IntegrationError(Exception):
    """The adaptive integrator found no step small enough: the state has left what the model describes."""


def runge_kutta_4(f: Derivative, state: Sequence[float], duration_s: float) -> list[float]:
    """Integrate with the classical fourth-order rule, in equal steps of at most `RK4_STEP_S`."""
    steps = max(1, round(duration_s / RK4_STEP_S))
    h = duration_s / steps
    x = list(state)
    for _ in range(steps):
        k1 = f(x)
        k2 = f([a + 0.5 * h * b for a, b in zip(x, k1, strict=True)])
        k3 = f([a + 0.5 * h * b for a, b in zip(x, k2, strict=True)])
        k4 = f([a + h * b for a, b in zip(x, k3, strict=True)])
        x = [a + h / 6.0 * (b + 2.0 * (c + d) + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)]
    return x


def dormand_prince(f: Derivative, state: Sequence[float], duration_s: float) -> list[float]:
    """Integrate with the embedded 4(5) pair of Dormand and Prince (Hairer's dopri5) to a tight tolerance.

    Raises:
        IntegrationError: No step was small enough.
    """
    from scipy.integrate import ode

    solver = ode(lambda _t, x: f(x.tolist()))
    solver.set_integrator("dopri5", rtol=RELATIVE_TOLERANCE, atol=ABSOLUTE_TOLERANCE, nsteps=100_000)
    solver.set_initial_value(list(state), 0.0)
    end: list[float] = solver.integrate(duration_s).tolist()
    if not solver.successful():
        raise IntegrationError(f"Dormand-Prince stopped after {solver.t:.6f} of {duration_s:.6f} s")
    return end


INTEGRATORS: dict[Integrator, Callable[[Derivative, Sequence[float], float], list[float]]] = {
    "rk4": runge_kutta_4,
    "adaptive": dormand_prince,
}
