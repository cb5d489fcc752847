"""From a thrust to the number of a SET_ATTITUDE_TARGET, and back: each stack has a convention of its own."""

from dataclasses import dataclass
from math import sqrt

_LEAST = 0.0
_MAX = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrustCurve:
    """The thrust convention of a stack that linearises its motors by a curve, as PX4 and ArduPilot do.

    A command u is turned into x with u = (1 - expo) x + expo x², x into a motor's signal between `spin_min` and
    `spin_max`. Thrust goes with the square of the signal where that is a rotor speed, else with the signal.

    Attributes:
        hover: The command that carries the weight.
        expo: PX4's THR_MDL_FAC, ArduPilot's MOT_THST_EXPO.
        spin_min, spin_max: ArduPilot's MOT_SPIN_MIN and MOT_SPIN_MAX; 0 and 1 of PX4.
        quadratic: Whether a signal is a rotor speed.
    """

    hover: float
    expo: float = 0.0
    spin_min: float = 0.0
    spin_max: float = 1.0
    quadratic: bool = True

    def command(self, load: float) -> float:
        """Return the command, 0..1, of a thrust in parts of the weight."""
        hover = self._signal(self.hover)
        signal = hover * sqrt(max(load, 0.0)) if self.quadratic else hover * max(load, 0.0)
        x = min(max((signal - self.spin_min) / (self.spin_max - self.spin_min), _LEAST), _MAX)
        return (1.0 - self.expo) * x + self.expo * x * x

    def load(self, command: float) -> float:
        """Return the thrust in parts of the weight, of a command of 0..1."""
        ratio = self._signal(min(max(command, _LEAST), _MAX)) / self._signal(self.hover)
        return ratio * ratio if self.quadratic else ratio

    def _signal(self, command: float) -> float:
        linear = 1.0 - self.expo
        x = 2.0 * command / (linear + sqrt(linear * linear + 4.0 * self.expo * command)) if command > 0.0 else 0.0
        return self.spin_min + (self.spin_max - self.spin_min) * x


@dataclass(frozen=True, slots=True, kw_only=True)
class MiddleHovers:
    """The thrust convention of Colibri's offboard mode: half carries the weight, all is the largest thrust.

    Attributes:
        max_load: The largest thrust, in parts of the weight.
    """

    max_load: float
    hover: float = 0.5

    def command(self, load: float) -> float:
        """Return the command, 0..1, of a thrust in parts of the weight."""
        if load <= 1.0:
            return 0.5 * max(load, 0.0)
        return min(0.5 + 0.5 * (load - 1.0) / (self.max_load - 1.0), 1.0)

    def load(self, command: float) -> float:
        """Return the thrust in parts of the weight, of a command of 0..1."""
        if command <= self.hover:
            return 2.0 * max(command, 0.0)
        return 1.0 + (min(command, 1.0) - 0.5) * 2.0 * (self.max_load - 1.0)


Thrust = ThrustCurve | MiddleHovers
