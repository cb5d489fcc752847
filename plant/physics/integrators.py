"""Integrators of one frame: fixed-step Runge-Kutta 4, and adaptive Dormand-Prince 5(4)."""

from math import ceil, sqrt
from typing import Literal, TypeAlias

import numpy as np

from colibri.common.jit import Packed, compiled
from colibri.common.kernels import power
from colibri.common.matrices import put
from colibri.common.types import Array, PerRotor
from colibri.plant.physics.equations import close, close_attitude, hold, write_derivative

Integrator: TypeAlias = Literal["rk4", "adaptive"]

RK4_STEP_S = 0.001
RELATIVE_TOLERANCE = 1e-9
ABSOLUTE_TOLERANCE = 1e-12
_MAX_STEPS = 10_000
_ROUNDING = 1e-6

_A = np.array(
    [
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
"""Weights of the slopes at each stage; the last ones are those of the fifth-order result."""
_ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])  # order 5 less 4
_STAGES = 7
_SAFETY, _MIN_FACTOR, _MAX_FACTOR, _EXPONENT = 0.9, 0.2, 10.0, -0.2
_TOO_SMALL = 1e-14  # smallest step, in parts of the frame


@compiled
def fixed_step(start: Array, target: PerRotor, parameters: Packed, duration_s: float, x: Array) -> tuple[float, bool]:
    """Write x after `duration_s` of commanded rotor speeds; return the battery's voltage, and whether x is finite."""
    steps = max(1, ceil(duration_s / RK4_STEP_S - _ROUNDING))
    voltage_v = runge_kutta_4(start, target, parameters, duration_s, steps, x)
    return voltage_v, close_attitude(x)


@compiled
def adaptive_step(
    start: Array, target: PerRotor, parameters: Packed, duration_s: float, x: Array
) -> tuple[float, bool]:
    """Integrate as `fixed_step` by Dormand-Prince; False also if the step size underflows."""
    voltage_v, done = dormand_prince(start, target, parameters, duration_s, x)
    return voltage_v, close_attitude(x) and done


@compiled
def runge_kutta_4(start: Array, target: PerRotor, parameters: Packed, duration_s: float, steps: int, x: Array) -> float:
    """Write x after `duration_s`; return the voltage then."""
    h = duration_s / steps
    hold(start, target, parameters, x)
    k1, k2, k3, k4 = np.empty_like(x), np.empty_like(x), np.empty_like(x), np.empty_like(x)
    y = np.empty_like(x)
    for _ in range(steps):
        write_derivative(k1, x, target, parameters[0])
        _write_sum(y, x, 0.5 * h, k1)
        write_derivative(k2, y, target, parameters[0])
        _write_sum(y, x, 0.5 * h, k2)
        write_derivative(k3, y, target, parameters[0])
        _write_sum(y, x, h, k3)
        write_derivative(k4, y, target, parameters[0])
        for i in range(x.size):
            x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
        close(x, parameters)
    return close(x, parameters)


@compiled
def dormand_prince(
    start: Array, target: PerRotor, parameters: Packed, duration_s: float, x: Array
) -> tuple[float, bool]:
    """Write x after `duration_s`; return the voltage then, and whether the end was reached.

    Dormand and Prince, J. Comput. Appl. Math. 6(1), 1980; step control: Hairer, Nørsett and Wanner, Solving Ordinary
    Differential Equations I, II.4.
    """
    hold(start, target, parameters, x)
    k = np.empty((_STAGES, x.size))
    y = np.empty_like(x)
    write_derivative(k[0], x, target, parameters[0])
    gone_s, h = 0.0, duration_s
    for _ in range(_MAX_STEPS):
        for stage in range(1, _STAGES):
            for i in range(x.size):
                slope = 0.0
                for j in range(stage):
                    slope += _A[stage - 1, j] * k[j, i]
                y[i] = x[i] + h * slope
            write_derivative(k[stage], y, target, parameters[0])
        error = _error(x, y, h, k)
        if error <= 1.0:
            gone_s += h
            put(y, x)
            put(k[_STAGES - 1], k[0])
            if gone_s >= duration_s:
                return close(x, parameters), True
        elif not h > _TOO_SMALL * duration_s:
            break
        factor = _SAFETY * power(error, _EXPONENT) if error > 0.0 else _MAX_FACTOR
        h = min(h * min(max(factor, _MIN_FACTOR), _MAX_FACTOR if error <= 1.0 else 1.0), duration_s - gone_s)
    return 0.0, False


@compiled
def _error(x: Array, y: Array, h: float, k: Array) -> float:
    total = 0.0
    for i in range(x.size):
        difference = 0.0
        for j in range(_STAGES):
            difference += _ERROR[j] * k[j, i]
        part = h * difference / (ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * max(abs(x[i]), abs(y[i])))
        total += part * part
    error = sqrt(total / x.size)
    return error if error < np.inf else np.inf


@compiled
def _write_sum(y: Array, x: Array, factor: float, k: Array) -> None:
    for i in range(x.size):
        y[i] = x[i] + factor * k[i]
