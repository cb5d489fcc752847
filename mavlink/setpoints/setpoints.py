"""Clients' setpoints, sticks and follow targets in SI, ENU and FLU."""

from math import isnan, nan
from typing import NamedTuple, TypeAlias

from colibri.common.kernels import cos, sin
from colibri.common.types import Quaternion, Vector

NOWHERE: Vector = (nan, nan, nan)
STILL: Vector = (0.0, 0.0, 0.0)


class PositionSetpoint(NamedTuple):
    """A setpoint of position and its derivatives; nan if not given. What has none of them is held."""

    position_enu_m: Vector = NOWHERE
    velocity_m_s: Vector = NOWHERE  # ENU; with `body`, FLU of a level vehicle
    acceleration_m_s2: Vector = NOWHERE  # in the same axes: feed-forward, or the only demand
    yaw_rad: float = nan  # counter-clockwise from east, -pi..pi
    yaw_rate_rad_s: float = nan
    body: bool = False
    time_us: int = 0

    def in_enu(self, heading_rad: float) -> "PositionSetpoint":
        if not self.body:
            return self
        return self._replace(
            velocity_m_s=turned(self.velocity_m_s, heading_rad),
            acceleration_m_s2=turned(self.acceleration_m_s2, heading_rad),
            body=False,
        )


class AttitudeSetpoint(NamedTuple):
    """A setpoint of attitude or body rates, and thrust."""

    attitude: Quaternion | None  # FLU to ENU
    rate_flu_rad_s: Vector  # nan if not given; feed-forward beside an attitude
    thrust: float  # 0..1 of the largest; nan if not given
    time_us: int = 0


OffboardSetpoint: TypeAlias = PositionSetpoint | AttitudeSetpoint


class Sticks(NamedTuple):
    pitch: float  # forward, -1..1
    roll: float  # right, -1..1
    thrust: float  # 0..1, centre 0.5
    yaw: float  # clockwise from above, -1..1
    time_us: int = 0


class TargetState(NamedTuple):
    """State of a target to follow; unknown derivatives are zero."""

    position_enu_m: Vector
    velocity_enu_m_s: Vector
    acceleration_enu_m_s2: Vector
    received_us: int = 0
    time_us: int = 0

    def at(self, now_us: int, max_us: int) -> "TargetState":
        """Return the state extrapolated at constant velocity until `max_us` after reception, then standing still."""
        after_s = max(min(now_us, self.received_us + max_us) - self.time_us, 0) * 1e-6
        (x, y, z), (vx, vy, vz) = self.position_enu_m, self.velocity_enu_m_s
        there = self._replace(position_enu_m=(x + after_s * vx, y + after_s * vy, z + after_s * vz), time_us=now_us)
        if now_us <= self.received_us + max_us:
            return there
        return there._replace(velocity_enu_m_s=STILL, acceleration_enu_m_s2=STILL)


def turned(flu: Vector, heading_rad: float) -> Vector:
    """Return a vector ahead, left and up in ENU; unchanged if both horizontal parts are nan."""
    ahead, left, up = flu
    if isnan(ahead) and isnan(left):
        return flu
    c, s = cos(heading_rad), sin(heading_rad)
    return (c * ahead - s * left, s * ahead + c * left, up)
