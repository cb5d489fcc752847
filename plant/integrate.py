"""Two ways to integrate x' = f(x) over a frame: fixed-step Runge-Kutta 4, and adaptive Dormand-Prince 4(5)."""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Literal, TypeAlias
from warnings import catch_warnings, simplefilter

Derivative: TypeAlias = Callable[[Sequence[float]], list[float]]
Solver: TypeAlias = Callable[[Derivative, Sequence[float], float], list[float]]
"""(f, state, duration in s) -> state after it."""
Integrator: TypeAlias = Literal["rk4", "adaptive"]

RK4_STEP_S = 0.001
RELATIVE_TOLERANCE = 1e-9
ABSOLUTE_TOLERANCE = 1e-12
_MOST_STEPS = 10_000


class IntegrationError(Exception):
    """The state cannot be integrated any further."""


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


def dormand_prince() -> Solver:
    """Return the embedded 4(5) pair of Dormand and Prince (Hairer's dopri5), held to a tight tolerance.

    The solver raises IntegrationError where no step is small enough.
    """
    from scipy.integrate import ode  # slow to load, and Runge-Kutta does without

    now: Derivative = list

    # One solver for every frame: each that is made leaks 1.7 kB in scipy 1.17 and 1.18.
    problem = ode(lambda _t, x: now(x.tolist()))
    problem.set_integrator("dopri5", rtol=RELATIVE_TOLERANCE, atol=ABSOLUTE_TOLERANCE, nsteps=_MOST_STEPS)

    def integrate(f: Derivative, state: Sequence[float], duration_s: float) -> list[float]:
        nonlocal now
        now = f
        problem.set_initial_value(list(state), 0.0)
        with catch_warnings():
            simplefilter("ignore")
            end: list[float] = problem.integrate(duration_s).tolist()
        if not problem.successful() or not all(map(isfinite, end)):
            raise IntegrationError("the state has left what the model describes: no step is small enough")
        return end

    return integrate


def solver(name: Integrator) -> Solver:
    """Return the solver of that name."""
    return dormand_prince() if name == "adaptive" else runge_kutta_4
