"""The battery as the vehicle file has it: the charge that the rotors took, and how fast they can turn on the rest.

No frame has the voltage, so it is followed as the rotors are: V = V0 - R I, V0 falling linearly with the
charge taken, and the rotors' top speed in proportion to V.
"""

from math import sqrt

from colibri.common.elementary import square
from colibri.common.jit import compiled
from colibri.common.matrices import dot
from colibri.common.types import Array
from colibri.plant.vehicle.description import Battery, Vehicle

_SECONDS_PER_HOUR = 3600.0
_INTERVALS = 100
_BISECTIONS = 40
_APART = 0.02
"""Model and battery may differ by this part of the charge; the model is the smoother of both."""


def estimated(model_ah: float, reported_ah: float, vehicle: Vehicle) -> float:
    """Return the charge taken, Ah, estimated from a model's integral and from what the battery itself reports."""
    if vehicle.battery is None:
        return model_ah
    return reported_ah if abs(reported_ah - model_ah) > _APART * vehicle.battery.capacity_ah else model_ah


class BatteryModel:
    """The battery of one vehicle; one that has none never tires."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Follow the battery of `vehicle`."""
        self._battery = vehicle.battery
        drag_torque = vehicle.rotors.torque_coefficient * square(vehicle.rotors.max_speed)
        efficiency = vehicle.battery.efficiency if vehicle.battery else 1.0
        self._full_power_w = drag_torque * vehicle.rad_s_per_speed_unit * vehicle.rotors.max_speed / efficiency
        self._max_speeds: dict[int, float] = {}
        if self._battery:
            self._step_ah = self._battery.capacity_ah / _INTERVALS

    def charge_after(self, charge_ah: float, speeds: Array, duration_s: float) -> float:
        """Return the charge taken, Ah, after `duration_s` at rotor speeds (4,), parts of the largest."""
        _, current_a = self.terminal(charge_ah, speeds)
        return charge_ah + current_a * duration_s / _SECONDS_PER_HOUR

    def terminal(self, charge_ah: float, speeds: Array) -> tuple[float, float]:
        """Return the terminal voltage, V, and the current, A, at rotor speeds (4,), parts of the largest; 0 without."""
        if self._battery is None:
            return 0.0, 0.0
        power_w = self._full_power_w * dot(speeds * speeds, speeds)
        voltage_v = _voltage_v(self._battery, charge_ah, power_w)
        return voltage_v, power_w / voltage_v

    def max_speed_now(self, charge_ah: float, speeds: Array) -> float:
        """Return the speed that a rotor can reach while all keep the power of `speeds`, (4,); parts of the largest."""
        if self._battery is None:
            return 1.0
        return self.terminal(charge_ah, speeds)[0] / self._battery.full_voltage_v

    def limit_squared(self, charge_ah: float, expected: Array, limits: Array) -> None:
        """Fill the largest squared speeds that a rotor can reach, (N,), while all have the power of those expected.

        Squared speeds are in parts of the largest; those expected, (n, 4), stay after the last.
        """
        if self._battery is None:
            limits[:] = 1.0
            return
        battery = self._battery
        open_v, full_v = open_voltage_v(battery, charge_ah), battery.full_voltage_v
        _fill_limits(expected, self._full_power_w, open_v, battery.resistance_ohm, full_v, limits)

    def max_common_speed(self, charge_ah: float) -> float:
        """Return the speed that all rotors can keep up together once `charge_ah` is taken, in parts of the largest."""
        if self._battery is None:
            return 1.0
        whole, part = divmod(charge_ah / self._step_ah, 1.0)
        if whole >= _INTERVALS:
            return self._balanced(self._battery, _INTERVALS)
        before, after = self._balanced(self._battery, int(whole)), self._balanced(self._battery, int(whole) + 1)
        return before + part * (after - before)

    def _balanced(self, battery: Battery, point: int) -> float:
        """Return the balance at so many steps of charge; found when first needed, so that it is quick to begin."""
        if point not in self._max_speeds:
            self._max_speeds[point] = self._balance(battery, self._step_ah * point)
        return self._max_speeds[point]

    def _balance(self, battery: Battery, charge_ah: float) -> float:
        """Find the speed, in parts of the largest, at which the voltage left is just in that proportion."""
        low, high = 0.0, 1.0
        for _ in range(_BISECTIONS):
            speed = 0.5 * (low + high)
            power_w = 4.0 * self._full_power_w * speed * speed * speed
            enough = _voltage_v(battery, charge_ah, power_w) >= speed * battery.full_voltage_v
            low, high = (speed, high) if enough else (low, speed)
        return low


def open_voltage_v(battery: Battery, charge_ah: float) -> float:
    """Return the voltage without load once `charge_ah` is taken."""
    used = min(charge_ah / battery.capacity_ah, 1.0)
    return battery.full_voltage_v + (battery.empty_voltage_v - battery.full_voltage_v) * used


def _voltage_v(battery: Battery, charge_ah: float, power_w: float) -> float:
    """Return the terminal voltage at which `power_w` is drawn: V² - V0 V + R P = 0, but at least half of V0."""
    open_v = open_voltage_v(battery, charge_ah)
    return 0.5 * (open_v + sqrt(max(0.0, open_v * open_v - 4.0 * battery.resistance_ohm * power_w)))


@compiled
def _fill_limits(
    expected: Array, full_power_w: float, open_v: float, resistance_ohm: float, full_v: float, limits: Array
) -> None:
    for n in range(limits.shape[0]):
        if n < expected.shape[0]:
            power_w = 0.0
            for rotor in range(expected.shape[1]):
                squared = min(max(expected[n, rotor], 0.0), 1.0)
                power_w += full_power_w * squared * sqrt(squared)
            voltage_v = 0.5 * (open_v + sqrt(max(0.0, open_v * open_v - 4.0 * resistance_ohm * power_w)))
            limits[n] = voltage_v / full_v * (voltage_v / full_v)
        else:
            limits[n] = limits[n - 1]
