"""Properties of a flight stack that a companion depends on, and its thrust convention in SET_ATTITUDE_TARGET."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from math import sqrt
from typing import NamedTuple, TypeAlias

from colibri.common.types import Vector
from colibri.mavlink.client.modes import FlightMode
from colibri.plant.vehicle.description import Vehicle


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


Parameters: TypeAlias = Mapping[str, float]
"""Parameters of the vehicle, by name."""

MAX_STALE_S = 0.3
"""So long a stack may follow the last body rates of a silent companion."""
ROUNDING = 1e-6
"""Of single precision on the wire."""


class TakeOffOrder(Enum):
    COMMAND_THEN_ARM = "take-off, then arm: the height is above the sea"
    ARM_THEN_COMMAND = "guided mode, arm, take-off: the height is above home"


class ParameterRule(NamedTuple):
    """A test of a parameter, with advice for a failure."""

    name: str
    right: Callable[[float], bool]
    action: str


class Response(NamedTuple):
    """Response of body rates to commands, a lag of first or second order, and of thrust, of first order.

    Attributes:
        time_constant_s: The rate loop demands the acceleration (command - rate) / time constant.
        latency_s: From a command's arrival to its first effect.
        max_rate_rad_s, max_acceleration_rad_s2: Limits in the stack.
        acceleration_lag_s: As from motors; 0 for first order.

    Too short a time constant costs bandwidth, too long a one stability: the assumed ones are short.
    """

    time_constant_s: Vector
    latency_s: float
    thrust_lag_s: float
    max_rate_rad_s: Vector
    max_acceleration_rad_s2: Vector
    acceleration_lag_s: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack:
    """A flight stack.

    Attributes:
        steady: `custom_mode` of modes that permit a take-over: the vehicle keeps its place.
        streams: Rates of requested messages, Hz.
        needed: Parameters without which nothing is flown; `optional` ones may not exist.
        fence: Parameters of the fence's radius and height, m; 0 disables it.
        response: Assumed without identification.
        integers_by_bits: Integer parameters travel bytewise.
    """

    name: str
    autopilot: int
    offboard: FlightMode
    hold: FlightMode
    last_resort: FlightMode
    steady: frozenset[int]
    streams: Mapping[str, float]
    needed: tuple[str, ...]
    optional: tuple[str, ...]
    rules: tuple[ParameterRule, ...]
    fence: tuple[str, str]
    thrust: Callable[[Parameters, Vehicle], Thrust]
    response: Response
    take_off: TakeOffOrder
    integers_by_bits: bool

    @property
    def parameters(self) -> tuple[str, ...]:
        return (*self.needed, *self.optional, *self.fence)
