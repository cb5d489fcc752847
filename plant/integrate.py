"""Two ways to go on by a frame: fixed-step Runge-Kutta 4, and adaptive Dormand-Prince 4(5), over one compiled f(x)."""

from collections.abc import Callable
from math import ceil
from typing import Literal, TypeAlias
from warnings import catch_warnings, simplefilter

from plant.dynamics import Array, FourOf, Packed, close, derivative, held, runge_kutta_4
from plant.scenario import IntegrationError

Solver: TypeAlias = Callable[[Array, FourOf, Packed, float], tuple[Array, float]]
"""(x, commanded rotor speeds, parameters, duration in s) -> x after it, the battery's voltage; see `plant.dynamics`."""
Integrator: TypeAlias = Literal["rk4", "adaptive"]

RK4_STEP_S = 0.001
RELATIVE_TOLERANCE = 1e-9
ABSOLUTE_TOLERANCE = 1e-12
_MOST_STEPS = 10_000
_ROUNDING = 1e-6


def fixed_step(x: Array, target: FourOf, parameters: Packed, duration_s: float) -> tuple[Array, float]:
    """Integrate by Runge-Kutta 4 in equal steps of at most `RK4_STEP_S`."""
    steps = max(1, ceil(duration_s / RK4_STEP_S - _ROUNDING))
    return runge_kutta_4(x, target, parameters, duration_s, steps)


def dormand_prince() -> Solver:
    """Return the embedded 4(5) pair of Dormand and Prince (Hairer's dopri5), held to a tight tolerance.

    The solver raises IntegrationError where no step is small enough.
    """
    from scipy.integrate import ode  # slow to load, and Runge-Kutta does without

    # One solver for every frame: each that is made leaks 1.7 kB in scipy 1.17 and 1.18.
    problem = ode(lambda _t, x, target, parameters: derivative(x, target, parameters))
    problem.set_integrator("dopri5", rtol=RELATIVE_TOLERANCE, atol=ABSOLUTE_TOLERANCE, nsteps=_MOST_STEPS)

    def integrate(x: Array, target: FourOf, parameters: Packed, duration_s: float) -> tuple[Array, float]:
        problem.set_f_params(target, parameters)
        problem.set_initial_value(held(x, target, parameters), 0.0)
        with catch_warnings():
            simplefilter("ignore")
            end: Array = problem.integrate(duration_s)
        if not problem.successful():
            raise IntegrationError("the state has left what the model describes: no step is small enough")
        return end, close(end, parameters)

    return integrate


def solver(name: Integrator) -> Solver:
    """Return the solver of that name."""
    return dormand_prince() if name == "adaptive" else fixed_step
