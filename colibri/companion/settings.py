"""How a companion is to fly: what the command line of `colibri companion` says, as one value."""

from dataclasses import dataclass, field
from enum import StrEnum
from math import inf

from colibri.companion.stacks.stack import Response, Stack
from colibri.companion.supervision.limits import FlightLimits


class SetpointKind(StrEnum):
    """What a vehicle is sent."""

    RATES = "rates"
    ATTITUDE = "attitude"
    VELOCITY = "velocity"
    POSITION = "position"


@dataclass(frozen=True, slots=True, kw_only=True)
class CompanionSettings:
    """How a companion is to fly.

    Attributes:
        may_arm: Whether it arms and takes off by itself.
        dry_run: Whether it only asks and computes: neither setpoints nor orders are sent.
        duration_s: Of the track; infinite for all of it.
        takeoff_height_m: Above where it stands; None for the height of the track's first point.
        gives_up_s: How long to wait for the vehicle, and until all checks pass.
        limits: Of the flight.
        setpoints: What is sent.
        stack: The vehicle's; None for the one that it says.
        identifies: Whether it flies the steps of an identification in place of the track.
        thrust_scale: Thrust that is made, in parts of the one that the vehicle's parameters mean, to begin with.
        response: Of its rates; None for what the stack assumes.
    """

    may_arm: bool = False
    dry_run: bool = False
    duration_s: float = inf
    takeoff_height_m: float | None = None
    gives_up_s: float = 60.0
    limits: FlightLimits = field(default_factory=FlightLimits)
    setpoints: SetpointKind = SetpointKind.RATES
    stack: Stack | None = None
    response: Response | None = None
    identifies: bool = False
    thrust_scale: float = 1.0
