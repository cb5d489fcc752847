"""Settings of a companion."""

from dataclasses import dataclass, field
from enum import StrEnum
from math import inf

from colibri.companion.stack import Response, Stack
from colibri.companion.steering.references import Stay
from colibri.companion.supervision.rules import FlightLimits
from colibri.companion.vehicle_peer import LocalOrigin


class SetpointKind(StrEnum):
    RATES = "rates"
    ATTITUDE = "attitude"
    VELOCITY = "velocity"
    POSITION = "position"


@dataclass(frozen=True, slots=True, kw_only=True)
class CompanionSettings:
    """Settings of a flight; `None` recognises stack or response."""

    may_arm: bool = False
    dry_run: bool = False
    duration_s: float = inf
    takeoff_height_m: float | None = None  # above the ground; `None` for the track's first point
    gives_up_s: float = 60.0  # timeout of connection and checks
    limits: FlightLimits = field(default_factory=FlightLimits)
    setpoints: SetpointKind = SetpointKind.RATES
    stack: Stack | None = None
    response: Response | None = None
    identifies: bool = False
    thrust_scale: float = 1.0
    stay: Stay | None = None  # the track is a hover where the vehicle is
    system: int = 0  # MAVLink system id; 0 for the only one on the link
    home: LocalOrigin | None = None  # where a mission was placed
