"""Speeds, heights and times of a flight."""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, radians

from colibri.autopilot.guidance.integrator_chain import Limits

_LIMITS = Limits()
_STICK_YAW_RATE_RAD_S = radians(120.0)


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Numbers of the vehicle's behaviour, described in `parameters/behaviour.csv`; 0 switches a limit or disarming off.

    An identity sets those from `return_delay_s` on: a return waits above home for `return_delay_s`, ends
    `return_final_m` above it, climbs less near home by `return_cone`, and faces its way with `return_faces`.
    By `items_face`, items of missions face their way or keep the heading; if None, each has its yaw. With
    `copter_items`, their heights of 0 keep the height, and take-offs may be to below the ground. With `rally_only`,
    rally points replace home. By `hover_throttle`, 0..1, the throttle stick has ArduCopter's curve.
    Landings by sticks disarm like others with `stick_landings_end`, else as before a flight.
    Landings are slow below `land_slow_below_m`.
    """

    limits: Limits = _LIMITS
    max_speed_m_s: float = 12.0
    takeoff_height_m: float = 2.5
    takeoff_speed_m_s: float = 1.5
    land_speed_m_s: float = 0.7
    return_height_m: float = 30.0
    return_radius_m: float = 5.0
    acceptance_m: float = 0.3
    disarm_after_landing_s: float = 2.0
    disarm_on_ground_s: float = 10.0
    setpoints_lost_s: float = 1.0
    sticks_lost_s: float = 0.5
    max_distance_m: float = 0.0
    max_height_m: float = 0.0
    max_tilt_deg: float = 35.0
    stick_yaw_rate_rad_s: float = _STICK_YAW_RATE_RAD_S
    stick_speed_m_s: float = 5.0
    track: str = "spiral"
    orbit_radius_m: float = 10.0
    follow_height_m: float = 8.0
    follow_distance_m: float = 8.0
    follow_angle_deg: float = 180.0
    follow_altitude_mode: int = 0
    rotor_failure: int = 1
    inject_failures: bool = False
    solve_time_s: float = 0.0
    delay_s: float = -0.001  # of commands, compensated; negative: the profile's, or measured
    return_delay_s: float = 0.0
    return_final_m: float = 0.0
    return_cone: float = 0.0
    return_speed_m_s: float = 0.0
    return_climb_m: float = 0.0
    return_faces: bool = True
    items_face: bool | None = None
    copter_items: bool = False
    rally_only: bool = False
    hover_throttle: float = 0.0
    stick_landings_end: bool = True
    land_high_m_s: float = 0.0
    land_slow_below_m: float = 0.0
    stick_limits: Limits | None = None  # of climbs by stick; None: `limits`
    uploaded_fence: bool = True
    floor_m: float = -inf


@lru_cache(maxsize=8)
def at_speed(behaviour: Behaviour, speed_m_s: float) -> Behaviour:
    return replace(behaviour, limits=behaviour.limits._replace(speed_m_s=speed_m_s))
