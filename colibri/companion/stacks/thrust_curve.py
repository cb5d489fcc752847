"""Thrust conventions of SET_ATTITUDE_TARGET, in both directions."""

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrustCurve:
    """Thrust convention of PX4 and ArduPilot.

    A command u becomes x with u = (1 - expo) x + expo x², and x a motor signal between `spin_min` and `spin_max`.
    Thrust is proportional to the square of a signal that is a rotor speed, else to the signal. `hover` carries the
    weight.
    """

    hover: float
    expo: float = 0.0
    spin_min: float = 0.0
    spin_max: float = 1.0
    quadratic: bool = True

    def command(self, load: float) -> float:
        """Convert a thrust, in weights, to a command, 0..1."""
        hover = self._signal(self.hover)
        signal = hover * sqrt(max(load, 0.0)) if self.quadratic else hover * max(load, 0.0)
        x = min(max((signal - self.spin_min) / (self.spin_max - self.spin_min), 0.0), 1.0)
        return (1.0 - self.expo) * x + self.expo * x * x

    def load(self, command: float) -> float:
        """Convert a command, 0..1, to a thrust in weights."""
        ratio = self._signal(min(max(command, 0.0), 1.0)) / self._signal(self.hover)
        return ratio * ratio if self.quadratic else ratio

    def _signal(self, command: float) -> float:
        linear = 1.0 - self.expo
        x = 2.0 * command / (linear + sqrt(linear * linear + 4.0 * self.expo * command)) if command > 0.0 else 0.0
        return self.spin_min + (self.spin_max - self.spin_min) * x


@dataclass(frozen=True, slots=True, kw_only=True)
class MiddleHovers:
    """Colibri's offboard mode: 0.5 carries the weight, 1 is the largest thrust, `max_load` weights."""

    max_load: float
    hover: float = 0.5

    def command(self, load: float) -> float:
        if load <= 1.0:
            return 0.5 * max(load, 0.0)
        return min(0.5 + 0.5 * (load - 1.0) / (self.max_load - 1.0), 1.0)

    def load(self, command: float) -> float:
        if command <= self.hover:
            return 2.0 * max(command, 0.0)
        return 1.0 + (min(command, 1.0) - 0.5) * 2.0 * (self.max_load - 1.0)


Thrust = ThrustCurve | MiddleHovers
