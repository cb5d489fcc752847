"""The numbers that a flight is flown by, apart from those of the control law: speeds, heights, times."""

from dataclasses import dataclass
from math import radians

from colibri.autopilot.guidance.integrator_chain import Limits

_LIMITS = Limits()
_STICK_YAW_RATE_RAD_S = radians(120.0)


@dataclass(frozen=True, slots=True)
class Behaviour:
    """How the vehicle behaves. Every number of it is a parameter of the ground station's.

    Attributes:
        limits: How fast the reference moves.
        max_speed_m_s: No command may ask for a higher horizontal speed.
        takeoff_height_m: Above where it stands.
        takeoff_speed_m_s: Of the climb.
        land_speed_m_s: Close to the ground.
        return_height_m: Above home, on the way there.
        return_radius_m: Closer to home than this it does not climb first.
        acceptance_m: Closer to a place than this it has arrived.
        disarm_after_landing_s: The rotors stop so long after a landing.
        disarm_on_ground_s: They stop if it does not take off for so long; 0 never.
        setpoints_lost_s: An offboard companion may be silent for so long.
        sticks_lost_s: A pilot may be silent for so long.
        max_distance_m: No farther from home than this, horizontally; 0: no limit.
        max_height_m: No higher above home than this; 0: no limit.
        max_tilt_deg: Of full sticks.
        stick_yaw_rate_rad_s: Of full sticks.
        stick_speed_m_s: Horizontally, of full sticks.
        track: Which track mode `track` flies.
        orbit_radius_m: Where a command does not say.
        follow_height_m: Above home.
        follow_distance_m: From the target.
        follow_angle_deg: Where from, clockwise from ahead of it: 180 is behind.
        follow_altitude_mode: Of PX4's FLW_TGT_ALT_M: 0 above home.
        land_on_three: Whether a rotor that is lost is noticed, and the vehicle landed on the others.
        inject_failures: Whether MAV_CMD_INJECT_FAILURE is obeyed.
        solve_time_s: That the control law is declared to take; 0 none.
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
    land_on_three: bool = True
    inject_failures: bool = False
    solve_time_s: float = 0.0
