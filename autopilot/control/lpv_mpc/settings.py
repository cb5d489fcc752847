"""The numbers of the flight profile's control law, read strictly from a profile's table."""

from typing import Annotated

import msgspec

from colibri.autopilot.control.lpv_mpc.attitude_mpc import AttitudeSettings
from colibri.autopilot.control.settings import ControlInterval, QpSettings
from colibri.common.config import Count, Degrees, Negative, Positive, Table

Part = Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]


class GuidanceSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The position loop."""

    poles: tuple[Negative, Negative]
    approach_speed_m_s: Positive
    max_tilt_deg: Degrees
    thrust_margin: Annotated[float, msgspec.Meta(ge=0.0, lt=0.5)]


class ObserverSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The disturbance observers."""

    acceleration_rad_s: Positive
    moment_rad_s: Positive
    max_acceleration_m_s2: Positive
    max_moment_n_m: Positive


class FallbackSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What flies when no plan can be had."""

    shifted_samples: Count
    lqr_samples: Count
    descent_thrust: Part
    turn_1_s: Positive
    rate_1_s: Positive
    max_rate_rad_s: Positive


class LpvMpcSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law."""

    control_interval_s: ControlInterval
    guidance: GuidanceSettings
    observer: ObserverSettings
    attitude: AttitudeSettings
    fallback: FallbackSettings
    qp: QpSettings
