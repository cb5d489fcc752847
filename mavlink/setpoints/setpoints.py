"""What clients ask a vehicle to do from moment to moment: setpoints, sticks, a target to follow; in SI, ENU and FLU."""

from math import isnan, nan
from typing import NamedTuple, TypeAlias

from colibri.common.kernels import cos, sin
from colibri.common.types import Quaternion, Vector

NOWHERE: Vector = (nan, nan, nan)
STILL: Vector = (0.0, 0.0, 0.0)


class PositionSetpoint(NamedTuple):
    """A setpoint of position and its derivatives; nan where nothing is asked for.

    An axis that has neither position nor velocity nor acceleration is the vehicle's own to hold; so is yaw without
    angle and rate.

    Attributes:
        position_enu_m: From the origin, m.
        velocity_m_s: ENU; where `body`, FLU of a level vehicle that looks along its heading.
        acceleration_m_s2: In the same axes: feed-forward, or all there is.
        yaw_rad: Counter-clockwise from east, -pi..pi.
        body: Whether velocity and acceleration turn with the vehicle: see `in_enu`.
    """

    position_enu_m: Vector = NOWHERE
    velocity_m_s: Vector = NOWHERE
    acceleration_m_s2: Vector = NOWHERE
    yaw_rad: float = nan
    yaw_rate_rad_s: float = nan
    body: bool = False
    time_us: int = 0

    def in_enu(self, heading_rad: float) -> "PositionSetpoint":
        """Return it with velocity and acceleration in ENU, for a vehicle that now looks along `heading_rad`."""
        if not self.body:
            return self
        return self._replace(
            velocity_m_s=turned(self.velocity_m_s, heading_rad),
            acceleration_m_s2=turned(self.acceleration_m_s2, heading_rad),
            body=False,
        )


class AttitudeSetpoint(NamedTuple):
    """A setpoint of attitude or body rates, and thrust.

    Attributes:
        attitude: Unit quaternion, FLU to ENU; None where only rates are asked for.
        rate_flu_rad_s: Body rates, nan on the axes that are not given; beside an attitude they are feed-forward.
        thrust: Part of the largest, 0..1; nan where it is not given.
    """

    attitude: Quaternion | None
    rate_flu_rad_s: Vector
    thrust: float
    time_us: int = 0


OffboardSetpoint: TypeAlias = PositionSetpoint | AttitudeSetpoint


class Sticks(NamedTuple):
    """The sticks of a remote control.

    Attributes:
        pitch: Forward, -1..1: positive flies forward.
        roll: To the right, -1..1.
        thrust: 0..1, the middle is 0.5.
        yaw: To the right, -1..1: positive turns clockwise seen from above.
    """

    pitch: float
    roll: float
    thrust: float
    yaw: float
    time_us: int = 0


class TargetState(NamedTuple):
    """Where what is to be followed is.

    Attributes:
        velocity_enu_m_s, acceleration_enu_m_s2: Zero where they are not known.
        time_us: What it is the state at.
    """

    position_enu_m: Vector
    velocity_enu_m_s: Vector
    acceleration_enu_m_s2: Vector
    received_us: int = 0
    time_us: int = 0

    def at(self, now_us: int, max_us: int) -> "TargetState":
        """Return it at `now_us`: it goes on at its velocity until `max_us` after it was received, then it stands."""
        after_s = max(min(now_us, self.received_us + max_us) - self.time_us, 0) * 1e-6
        (x, y, z), (vx, vy, vz) = self.position_enu_m, self.velocity_enu_m_s
        there = self._replace(position_enu_m=(x + after_s * vx, y + after_s * vy, z + after_s * vz), time_us=now_us)
        if now_us <= self.received_us + max_us:
            return there
        return there._replace(velocity_enu_m_s=STILL, acceleration_enu_m_s2=STILL)


def turned(flu: Vector, heading_rad: float) -> Vector:
    """Return a vector of axes along `heading_rad`, to its left and up, in ENU; nan where both of the first are."""
    ahead, left, up = flu
    if isnan(ahead) and isnan(left):
        return flu
    c, s = cos(heading_rad), sin(heading_rad)
    return (c * ahead - s * left, s * ahead + c * left, up)
