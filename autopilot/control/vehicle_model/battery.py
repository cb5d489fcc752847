"""The battery model: charge taken by the rotors, and the rotor speed that the voltage allows.

V = V0 - R I, V0 linear in the charge taken, top speed proportional to V.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.elementary import square
from colibri.common.jit import Packed, compiled, packed
from colibri.common.types import Array
from colibri.plant.vehicle.description import Battery, Vehicle

_SECONDS_PER_HOUR = 3600.0
_INTERVALS = 100
_BISECTIONS = 40
_APART = 0.02  # largest difference from the battery's report, in parts of the capacity: the model is smoother


def estimated(model_ah: float, reported_ah: float, vehicle: Vehicle) -> float:
    if vehicle.battery is None:
        return model_ah
    return reported_ah if abs(reported_ah - model_ah) > _APART * vehicle.battery.capacity_ah else model_ah


class BatteryNumbers(NamedTuple):
    """Battery parameters for kernels; defaults without a battery."""

    full_power_w: float = 0.0  # of a rotor at its largest speed
    full_voltage_v: float = 1.0
    resistance_ohm: float = 0.0
    empty_voltage_v: float = 1.0
    capacity_ah: float = 1.0
    common: Array = np.ones(_INTERVALS + 1)  # speed available to all rotors at once, at equal steps of the charge


class BatteryModel:
    """The battery of one vehicle; without one, power is unlimited."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._battery = battery = vehicle.battery
        drag_torque = vehicle.rotors.torque_coefficient * square(vehicle.rotors.max_speed)
        self.numbers = packed(BatteryNumbers())
        if battery:
            power_w = drag_torque * vehicle.rad_s_per_speed_unit * vehicle.rotors.max_speed / battery.efficiency
            known = (battery.full_voltage_v, battery.resistance_ohm, battery.empty_voltage_v, battery.capacity_ah)
            self.numbers = packed(BatteryNumbers(power_w, *known))
            _fill_common(float(vehicle.rotors.count), self.numbers)

    def charge_after(self, charge_ah: float, speeds: Array, duration_s: float) -> float:
        _, current_a = self.terminal(charge_ah, speeds)
        return charged(charge_ah, current_a, duration_s)

    def open_voltage_v(self, charge_ah: float) -> float:
        return 1.0 if self._battery is None else open_voltage_v(self._battery, charge_ah)

    def terminal(self, charge_ah: float, speeds: Array) -> tuple[float, float]:
        if self._battery is None:
            return 0.0, 0.0
        at_terminal: tuple[float, float] = terminal(open_voltage_v(self._battery, charge_ah), speeds, self.numbers)
        return at_terminal

    def max_speed_now(self, charge_ah: float, speeds: Array) -> float:
        if self._battery is None:
            return 1.0
        return self.terminal(charge_ah, speeds)[0] / self._battery.full_voltage_v

    def max_common_speed(self, charge_ah: float) -> float:
        """Return the speed available to all rotors at once, in parts of the largest."""
        speed: float = common_speed(charge_ah, self.numbers)
        return speed


def charged(charge_ah: float, current_a: float, duration_s: float) -> float:
    return charge_ah + current_a * duration_s / _SECONDS_PER_HOUR


def open_voltage_v(battery: Battery | BatteryNumbers, charge_ah: float) -> float:
    used = min(charge_ah / battery.capacity_ah, 1.0)
    return battery.full_voltage_v + (battery.empty_voltage_v - battery.full_voltage_v) * used


open_voltage, drawn_ah = compiled(open_voltage_v), compiled(charged)


@compiled
def common_speed(charge_ah: float, packed: Packed) -> float:
    battery = packed[0]
    steps = max(charge_ah / (battery.capacity_ah / _INTERVALS), 0.0)
    if steps >= _INTERVALS:
        return float(battery.common[_INTERVALS])
    before, after = battery.common[int(steps)], battery.common[int(steps) + 1]
    return float(before + (steps - int(steps)) * (after - before))


@compiled
def _fill_common(rotors: float, packed: Packed) -> None:
    battery = packed[0]
    for step in range(_INTERVALS + 1):
        open_v = open_voltage(battery, battery.capacity_ah / _INTERVALS * step)
        low, high = 0.0, 1.0
        for _ in range(_BISECTIONS):
            speed = 0.5 * (low + high)
            power_w = rotors * battery.full_power_w * speed * speed * speed
            enough = loaded_voltage_v(open_v, power_w, battery.resistance_ohm) >= speed * battery.full_voltage_v
            low, high = (speed, high) if enough else (low, speed)
        battery.common[step] = low


@compiled
def loaded_voltage_v(open_v: float, power_w: float, resistance_ohm: float) -> float:
    """Return V at a power: V² - V0 V + R P = 0, at least half of V0."""
    return 0.5 * (open_v + sqrt(max(0.0, open_v * open_v - 4.0 * resistance_ohm * power_w)))


@compiled
def terminal(open_v: float, speeds: Array, packed: Packed) -> tuple[float, float]:
    cubes = 0.0
    for speed in speeds:
        cubes += speed * speed * speed
    power_w = packed[0].full_power_w * cubes
    voltage_v = loaded_voltage_v(open_v, power_w, packed[0].resistance_ohm)
    return voltage_v, power_w / voltage_v


@compiled
def fill_limits(expected: Array, open_v: float, packed: Packed, limits: Array) -> None:
    """Fill the largest squared rotor speeds, (N,), in parts of the largest, at the power of all rotors.

    `expected` squared speeds, (n, m), give the power; the last limit is repeated.
    """
    numbers = packed[0]
    for n in range(limits.shape[0]):
        if n < expected.shape[0]:
            power_w = 0.0
            for rotor in range(expected.shape[1]):
                squared = min(max(expected[n, rotor], 0.0), 1.0)
                power_w += numbers.full_power_w * squared * sqrt(squared)
            part = loaded_voltage_v(open_v, power_w, numbers.resistance_ohm) / numbers.full_voltage_v
            limits[n] = part * part
        else:
            limits[n] = limits[n - 1]
