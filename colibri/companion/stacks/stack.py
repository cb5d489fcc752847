"""A flight stack as a value: what of a vehicle depends on the software that flies it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias

from colibri.common.types import Vector
from colibri.companion.stacks.thrust_curve import Thrust
from colibri.mavlink.client.modes import FlightMode
from colibri.plant.vehicle.description import Vehicle

Parameters: TypeAlias = Mapping[str, float]
"""Parameters that the vehicle has, by name."""


class TakeOff(Enum):
    """How a stack takes off."""

    COMMAND_THEN_ARM = "take-off, then arm: the height is above the sea"
    ARM_THEN_COMMAND = "guided mode, arm, take-off: the height is above home"


class ParameterRule(NamedTuple):
    """What a parameter of the vehicle must be before a flight.

    Attributes:
        name: Of the parameter; one that the vehicle has not passes.
        right: Whether a value will do.
        action: What to do where it will not.
    """

    name: str
    right: Callable[[float], bool]
    action: str


class Response(NamedTuple):
    """How body rates follow their commands, by a lag of first or second order, and thrust by its own.

    Attributes:
        time_constant_s: Of p, q, r, s: a rate loop asks for an acceleration of (command - rate) / time constant.
        latency_s: Between a command's arrival and its first effect, s.
        thrust_lag_s: Of thrust, s; 0 where it follows at once.
        max_rate_rad_s: Commands beyond are cut by the stack.
        max_acceleration_rad_s2: So fast, at most, the stack lets each rate change.
        acceleration_lag_s: Of that acceleration, of p, q, r, s: the motors', say; 0 where it is there at once.

    A time constant that is too short costs bandwidth, one that is too long stability: what is assumed is short.
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
        autopilot: MAV_AUTOPILOT of its HEARTBEAT.
        offboard: The mode that takes setpoints.
        hold: The mode that the vehicle is left in.
        last_resort: The mode for a vehicle that cannot hold.
        steady: Modes, by `custom_mode`, out of which a companion may take over by itself: the vehicle stays by itself.
        streams: The messages asked for, and their rates, Hz.
        parameters: Those to be read.
        rules: What parameters must be.
        fence: Parameters of the fence's radius and height, m; 0 is none.
        thrust: The thrust convention, by parameters and vehicle.
        response: What is assumed where nothing was identified.
        take_off: How it takes off.
        integers_by_bits: Whether integer parameters travel bytewise, or as numbers.
    """

    name: str
    autopilot: int
    offboard: FlightMode
    hold: FlightMode
    last_resort: FlightMode
    steady: frozenset[int]
    streams: Mapping[str, float]
    parameters: tuple[str, ...]
    rules: tuple[ParameterRule, ...]
    fence: tuple[str, str]
    thrust: Callable[[Parameters, Vehicle], Thrust]
    response: Response
    take_off: TakeOff
    integers_by_bits: bool
