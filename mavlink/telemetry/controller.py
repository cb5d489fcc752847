"""Messages of the control law: setpoint, plan and solver."""

from math import degrees, hypot, isnan, nan

from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.earth.geodesy import geodetic_of
from colibri.common.kernels import atan2
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import UNKNOWN_U16, minus, yaw_ned
from colibri.mavlink.telemetry.snapshot import Forecast, Setpoint, TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

POINTS = 5  # capacity of TRAJECTORY_REPRESENTATION_WAYPOINTS
FLOATS = 58  # capacity of DEBUG_FLOAT_ARRAY
ARRAY_NAME = b"lpv_mpc"


def attitude_target(s: TelemetrySnapshot) -> Fields:
    """ATTITUDE_TARGET (83): quaternion NED/FRD, rates FRD rad/s, thrust 0..1."""
    setpoint = s.setpoint
    rates = frd_from_flu(setpoint.rate_flu_rad_s)
    ignore = sum(1 << bit for bit, rate in enumerate(rates) if isnan(rate))
    if any(map(isnan, setpoint.attitude)):
        ignore |= mav.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
    return (s.boot_ms, ignore, ned_frd_from_enu_flu(setpoint.attitude), *rates, setpoint.thrust)


def position_target_local_ned(s: TelemetrySnapshot) -> Fields:
    """POSITION_TARGET_LOCAL_NED (85): m, m/s, m/s², rad; unused fields are NaN and masked."""
    position = ned_from_enu(s.setpoint.position_enu_m)
    moving = _moving_ned(s.setpoint)
    return (s.boot_ms, mav.MAV_FRAME_LOCAL_NED, _ignored((*position, *moving)), *position, *moving)


def position_target_global_int(s: TelemetrySnapshot) -> Fields:
    """POSITION_TARGET_GLOBAL_INT (87): degE7, m above sea level; else as POSITION_TARGET_LOCAL_NED."""
    moving = _moving_ned(s.setpoint)
    mask = _ignored((*ned_from_enu(s.setpoint.position_enu_m), *moving))
    east, north, up = s.setpoint.position_enu_m
    if isnan(east) or isnan(north):
        place = (0.0, 0.0)
    else:
        latitude, longitude, _ = geodetic_of((east, north, 0.0), s.origin)
        place = (1e7 * latitude, 1e7 * longitude)
    return (s.boot_ms, mav.MAV_FRAME_GLOBAL, mask, *place, up + s.origin.altitude_m, *moving)


def nav_controller_output(s: TelemetrySnapshot) -> Fields:
    """NAV_CONTROLLER_OUTPUT (62): degrees and m to the destination; 0 m without one."""
    roll, pitch, yaw = euler_from_quaternion(s.setpoint.attitude)
    target = s.setpoint.position_enu_m if any(map(isnan, s.target_enu_m)) else s.target_enu_m
    east, north, up = (0.0, 0.0, 0.0) if any(map(isnan, target)) else minus(target, s.position_enu_m)
    distance = hypot(east, north)
    heading = yaw if isnan(s.setpoint.yaw_rad) else s.setpoint.yaw_rad
    towards = atan2(north, east) if distance > 0.0 else heading
    bearings = (degrees(yaw_ned(heading)), degrees(yaw_ned(towards)))
    return (degrees(roll), degrees(-pitch), *bearings, distance, up, 0.0, 0.0)


def trajectory_representation_waypoints(s: TelemetrySnapshot) -> Fields | None:
    """TRAJECTORY_REPRESENTATION_WAYPOINTS (332): five points of the predicted horizon, local NED."""
    points = _spread(s.solver.horizon)
    if not points:
        return None
    rows = [_row(point) for point in points] + [(nan,) * 11] * (POINTS - len(points))
    columns = tuple(zip(*rows, strict=True))
    return (s.time_us, len(points), *columns, (UNKNOWN_U16,) * POINTS)


def debug_float_array(s: TelemetrySnapshot) -> Fields:
    """DEBUG_FLOAT_ARRAY (350) "lpv_mpc", id 0: solver figures, then the plan.

    Figures: status, fallback, iterations, solve_us, step_us, cost, slack; active bounds on rotors, increments, angles,
    rates (codes: `SolverState`). Plan: squared rotor speeds over the maximum, all rotors a step.
    """
    solver = s.solver
    times_us = (1e6 * solver.solve_time_s, 1e6 * solver.step_time_s)
    head = (solver.status, solver.fallback, solver.iterations, *times_us, solver.cost, solver.slack, *solver.active)
    planned = [speed for step in solver.planned_squared for speed in step]
    rotors = len(solver.planned_squared[0]) if solver.planned_squared else 1
    whole_steps = (FLOATS - len(head)) // rotors * rotors
    data = (*map(float, head), *planned[:whole_steps])
    return (s.time_us, ARRAY_NAME, 0, data + (0.0,) * (FLOATS - len(data)))


def named_value_float(s: TelemetrySnapshot) -> list[Fields]:
    """NAMED_VALUE_FLOAT (251): a message for each figure of the law, and the compensated delay."""
    solver = s.solver
    figures: dict[bytes, float] = {
        b"mpc_status": solver.status,
        b"mpc_fall": solver.fallback,
        b"mpc_iter": solver.iterations,
        b"mpc_us": 1e6 * solver.solve_time_s,
        b"step_us": 1e6 * solver.step_time_s,
        b"mpc_cost": solver.cost,
        b"mpc_slack": solver.slack,
        b"mpc_active": sum(solver.active),
        b"delay_us": s.delay_us,
    }
    if not isnan(solver.mass_kg):
        figures[b"mass_kg"] = solver.mass_kg
    if not isnan(solver.path_lag_s):
        figures[b"path_lag_s"] = solver.path_lag_s
    return [(s.boot_ms, name, float(value)) for name, value in figures.items()]


def _row(point: Forecast) -> tuple[float, ...]:
    motion = (point.position_enu_m, point.velocity_enu_m_s, point.acceleration_enu_m_s2)
    return (*(x for vector in motion for x in ned_from_enu(vector)), yaw_ned(point.yaw_rad), -point.yaw_rate_rad_s)


def _spread(horizon: tuple[Forecast, ...]) -> list[Forecast]:
    count = min(POINTS, len(horizon))
    return [horizon[(number + 1) * len(horizon) // count - 1] for number in range(count)]


def _moving_ned(setpoint: Setpoint) -> tuple[float, ...]:
    velocity, acceleration = setpoint.velocity_enu_m_s, setpoint.acceleration_enu_m_s2
    yaw = (yaw_ned(setpoint.yaw_rad), -setpoint.yaw_rate_rad_s)
    return (*ned_from_enu(velocity), *ned_from_enu(acceleration), *yaw)


def _ignored(values: tuple[float, ...]) -> int:
    force_bit = 9
    return sum(1 << (bit + (bit >= force_bit)) for bit, value in enumerate(values) if isnan(value))
