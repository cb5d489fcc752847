"""The rotor lag and its inverse, as compiled kernels; speeds in parts of the largest, (m,).

Control laws plan forces with one linear lag, the slower of the rotors' two. Commands then bring each squared speed, the
force, to its planned value at the next sample.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.jit import Packed, compiled
from colibri.common.kernels import exp
from colibri.common.matrices import put
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle


class SampledLag(NamedTuple):
    """Response of a rotor in one control sample, and its limit."""

    up: float  # part of the way to a higher command
    down: float  # part of the way to a lower one
    planned: float  # part of the way of the force in the plan
    min_speed: float


class RotorModel(NamedTuple):
    lag: SampledLag
    allocation: Array  # squared speeds to U1 (N), U2, U3, U4 (N m), (4, m)
    top: float  # largest speed, the vehicle's unit


def rotor_lag(vehicle: Vehicle, interval_s: float) -> SampledLag:
    lag = vehicle.rotors.lag
    up = 1.0 - exp(-interval_s / lag.time_constant_up_s) if lag else 1.0
    down = 1.0 - exp(-interval_s / lag.time_constant_down_s) if lag else 1.0
    return SampledLag(up, down, min(up, down), vehicle.rotors.idle_speed / vehicle.rotors.max_speed)


@compiled
def follow(speeds: Array, commands: Array, lag: SampledLag) -> Array:
    after = np.empty_like(speeds)
    for i in range(speeds.shape[0]):
        way = commands[i] - speeds[i]
        after[i] = speeds[i] + way * (lag.up if way > 0.0 else lag.down)
    return after


@compiled
def lead(speeds: Array, squared_commands: Array, lag: SampledLag, max_speed: float) -> Array:
    """Return the commands that bring squared speeds to their planned values a sample later."""
    commands = np.empty_like(speeds)
    for i in range(speeds.shape[0]):
        squared = speeds[i] * speeds[i]
        after = sqrt(max(squared + (squared_commands[i] - squared) * lag.planned, 0.0))
        way = after - speeds[i]
        command = speeds[i] + way / (lag.up if way > 0.0 else lag.down)
        commands[i] = min(max(command, lag.min_speed), max_speed)
    return commands


@compiled
def actuate(before: Array, squared_commands: Array, max_speed: float, packed: Packed, out: Array) -> None:
    """Write commands in the vehicle's unit, speeds and wrench a sample later, and the mean wrench, as in `before`."""
    lag, allocation, rotors = packed[0].lag, packed[0].allocation, packed[0].allocation.shape[1]
    speeds = before[1, :rotors]
    commands, after, wrench, mean = out[0, :rotors], out[1, :rotors], out[2], out[3]
    put(lead(speeds, squared_commands, lag, max_speed), commands)
    put(follow(speeds, commands, lag), after)
    wrench[:], mean[:] = 0.0, 0.0
    for row in range(allocation.shape[0]):
        for i in range(speeds.shape[0]):
            wrench[row] += allocation[row, i] * after[i] * after[i]
            mean[row] += 0.5 * allocation[row, i] * (speeds[i] * speeds[i] + after[i] * after[i])
    for i in range(speeds.shape[0]):
        commands[i] *= packed[0].top
