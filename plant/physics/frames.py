"""Frames with the same commands, flown in one call, and the truth after each.

A row of the truth: time, µs; `equations.STATE`; speeds of four rotors; battery's voltage, V, and charge used, Ah; wind,
m/s, ENU; and if there are more rotors, the speeds of four others. What is missing is nan.
"""

from collections.abc import Callable
from math import inf, nan
from typing import TypeAlias

from colibri.common.jit import Packed, compiled
from colibri.common.matrices import put
from colibri.common.types import Array, PerRotor
from colibri.plant.physics.equations import CHARGE
from colibri.plant.physics.integrators import Integrator, adaptive_step, fixed_step

STATE, ROTORS, VOLTAGE, USED, WIND, OTHER_ROTORS = 1, 14, 18, 19, 20, 23  # the first column of each
_SPEEDS, _AT_ONCE = 13, 4  # in x; rotors of a row that come together

Frames: TypeAlias = Callable[[Array, PerRotor, Packed, int, int, Array], int]  # as `fixed_frames`


def row_width(rotors: int) -> int:
    return OTHER_ROTORS + (_AT_ONCE if rotors > _AT_ONCE else 0)


def frames_by(name: Integrator) -> Frames:
    return adaptive_frames if name == "adaptive" else fixed_frames


@compiled
def fixed_frames(x: Array, target: PerRotor, parameters: Packed, time_us: int, interval_us: int, rows: Array) -> int:
    """Advance x, see `equations`, by a frame for each row, (n, columns), with commanded rotor speeds.

    Return how many rows are written: all of them, if x has stayed finite.
    """
    end = x.copy()
    for n in range(len(rows)):
        voltage_v, is_finite = fixed_step(x, target, parameters, interval_us * 1e-6, end)
        if not is_finite:
            return n
        put(end, x)
        time_us += interval_us
        _write(x, voltage_v, time_us, parameters, rows[n])
    return len(rows)


@compiled
def adaptive_frames(x: Array, target: PerRotor, parameters: Packed, time_us: int, interval_us: int, rows: Array) -> int:
    """Advance as `fixed_frames` by Dormand-Prince."""
    end = x.copy()
    for n in range(len(rows)):
        voltage_v, is_finite = adaptive_step(x, target, parameters, interval_us * 1e-6, end)
        if not is_finite:
            return n
        put(end, x)
        time_us += interval_us
        _write(x, voltage_v, time_us, parameters, rows[n])
    return len(rows)


@compiled
def _write(x: Array, voltage_v: float, time_us: int, parameters: Packed, row: Array) -> None:
    wind, rotors = parameters[0].wind_enu_m_s, len(parameters[0].thrust)
    row[0], row[USED] = time_us, x[CHARGE]
    row[VOLTAGE] = nan if parameters[0].capacity_ah == inf else voltage_v
    for i in range(_SPEEDS):
        row[STATE + i] = x[i]
    for rotor in range(_AT_ONCE if row.size == OTHER_ROTORS else 2 * _AT_ONCE):
        at = ROTORS + rotor if rotor < _AT_ONCE else OTHER_ROTORS + rotor - _AT_ONCE
        row[at] = x[_SPEEDS + rotor] if rotor < rotors else nan
    for i in range(3):
        row[WIND + i] = wind[i]
