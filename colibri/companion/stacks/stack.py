"""Properties of a flight stack that a companion depends on."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias

from colibri.common.types import Vector
from colibri.companion.stacks.thrust_curve import Thrust
from colibri.mavlink.client.modes import FlightMode
from colibri.plant.vehicle.description import Vehicle

Parameters: TypeAlias = Mapping[str, float]
"""Parameters of the vehicle, by name."""

MAX_STALE_S = 0.3
"""So long a stack may follow the last body rates of a silent companion."""
ROUNDING = 1e-6
"""Of single precision on the wire."""


class TakeOffOrder(Enum):
    """Order of the take-off commands."""

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
        needed: Parameters without which nothing is flown; others may not exist.
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
    parameters: tuple[str, ...]
    needed: tuple[str, ...]
    rules: tuple[ParameterRule, ...]
    fence: tuple[str, str]
    thrust: Callable[[Parameters, Vehicle], Thrust]
    response: Response
    take_off: TakeOffOrder
    integers_by_bits: bool
