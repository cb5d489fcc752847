"""The outer loop: feedback linearisation of the position, THESIS [3.24-3.33]."""

from typing import NamedTuple

from colibri.autopilot.control.parts.error_dynamics import gains
from colibri.common.config import Count, Negative, Table
from colibri.common.kernels import atan, cos, sin
from colibri.common.types import Vector
from colibri.plant.vehicle.description import Vehicle

_MIN_LIFT = 0.05  # least demanded lift in parts of gravity: the law is undefined for downward thrust


class PositionSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The outer loop."""

    samples: Count
    """Control samples in one outer sample."""
    poles: tuple[Negative, Negative]
    """Closed-loop poles of each axis, rad/s."""


class AttitudeAndThrust(NamedTuple):
    """Demand of the outer loop."""

    phi: float  # rad
    theta: float  # rad
    thrust_n: float  # U1


class PositionController:
    """Turns the acceleration of placed poles into tilt and thrust."""

    def __init__(self, settings: PositionSettings, vehicle: Vehicle) -> None:
        self._k1, self._k2 = gains(settings.poles)
        self._mass_kg = vehicle.body.mass_kg
        self._gravity_m_s2 = vehicle.gravity_m_s2

    def step(
        self,
        position_enu_m: Vector,
        velocity_enu_m_s: Vector,
        position_reference_enu_m: Vector,
        velocity_reference_enu_m_s: Vector,
        yaw_reference_rad: float,
    ) -> AttitudeAndThrust:
        """Return tilt and thrust for v = k1 e + k2 e' (erratum 5); the thesis's two cases of phi_ref are one."""
        errors = zip(position_reference_enu_m, position_enu_m, strict=True)
        speed_errors = zip(velocity_reference_enu_m_s, velocity_enu_m_s, strict=True)
        vx, vy, vz = (
            self._k1 * (wanted - is_now) + self._k2 * (speed_wanted - speed)
            for (wanted, is_now), (speed_wanted, speed) in zip(errors, speed_errors, strict=True)
        )
        lift = max(vz + self._gravity_m_s2, _MIN_LIFT * self._gravity_m_s2)
        a, b = vx / lift, vy / lift
        c, d = cos(yaw_reference_rad), sin(yaw_reference_rad)
        theta = atan(a * c + b * d)
        phi = atan(cos(theta) * (a * d - b * c))
        return AttitudeAndThrust(phi, theta, self._mass_kg * lift / (cos(phi) * cos(theta)))
