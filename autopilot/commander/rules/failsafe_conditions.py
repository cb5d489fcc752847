"""Since when each condition of the failsafes holds: all that the vehicle may lose is looked at here, and nowhere else.

Only simulated time counts, and nothing that a clock measures: in lockstep the same flight loses the same things.
"""

from collections.abc import Callable, Container, Mapping
from math import hypot, radians, sqrt
from typing import NamedTuple

from colibri.autopilot.commander.rules.failsafe_parameters import Limits
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import MANUAL, Mode
from colibri.autopilot.control.interface import Diagnostics, Fallback, VehicleState
from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.guidance.integrator_chain import Limits as Pace
from colibri.common.types import Vector
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, OffboardSetpoint
from colibri.mavlink.telemetry.snapshot import BatteryState

NEVER_US = -(10**12)
"""Since when everybody could be heard who is there, where nothing was restarted."""
PLACELESS = (Mode.STABILIZED, Mode.ALTITUDE)
"""Modes that need no position."""
_FROZEN_M, _FROZEN_RAD = 0.05, 0.05
"""So far a vehicle must have come by its own account, for its rest to be a lie and not the rounding of a frame."""
_PLANLESS = (Fallback.SHIFTED_PLAN, Fallback.LQR, Fallback.DESCENT)
"""What decides where no QP is solved; recovery is no failure, but how a vehicle turns upright."""


class FailsafeInputs(NamedTuple):
    """What the conditions are judged by.

    Attributes:
        now_us: Simulated time.
        missed_us: When the frame came that was the last before frames were missed; None if none were.
        state: The vehicle, as it is told or estimated.
        mode: The flight mode.
        standing: Whether it stands on the ground.
        estimate: What the state is worth; None where it is told.
        setpoint: The companion's last, however old; None if it has ended its stream.
        sticks_us: When the pilot's sticks were last heard; None if they were released.
        listening_us: Since when anybody could be heard: since a restart in flight.
        station_us: When a ground station was last heard; None if there never was one.
        battery: None without one.
        fence: Says how far a place is inside of every fence, m; None without any.
        decided: How the last decision of the control law came about; None while it decides nothing.
        late: Whether the declared solve time is longer than a control sample.
        rotor_lost: A rotor that makes no thrust, counted from 0; None if all do.
        pace: How fast the vehicle may brake.
    """

    now_us: int
    missed_us: int | None
    state: VehicleState
    mode: Mode
    standing: bool
    estimate: Estimate | None
    setpoint: OffboardSetpoint | None
    sticks_us: int | None
    listening_us: int
    station_us: int | None
    battery: BatteryState | None
    fence: Callable[[Vector], float] | None
    decided: Diagnostics | None
    late: bool
    rotor_lost: int | None
    pace: Pace


class Conditions:
    """Looks at one vehicle, sample after sample."""

    def __init__(self) -> None:
        """Begin with nothing lost."""
        self._since_us: dict[Condition, int] = {}
        self._told: tuple[Vector, object] | None = None
        self._told_us = 0

    def look(self, inputs: FailsafeInputs, limits: Limits, held: Container[Condition]) -> Mapping[Condition, int]:
        """Return since when each condition holds; those that do not are not in it. `held` are lost already."""
        before, self._since_us = self._since_us, {}
        for condition, is_so in _LOOKS:
            if is_so(inputs, limits):
                self._since_us[condition] = before.get(condition, inputs.now_us)
        found = dict(self._since_us)
        frozen_us = self._frozen_since(inputs)
        if frozen_us is not None:
            found[Condition.ATTITUDE_LOST] = frozen_us
        for condition, since in _AGES:
            since_us = since(inputs, condition in held)
            if since_us is not None:
                found[condition] = since_us
        return found

    def _frozen_since(self, inputs: FailsafeInputs) -> int | None:
        """Return since when what is told stays the same though it says that it moves; None if it does not."""
        told = (inputs.state.position_enu_m, inputs.state.attitude)
        if told != self._told or inputs.standing:
            self._told, self._told_us = told, inputs.now_us
            return None
        for_s = (inputs.now_us - self._told_us) * 1e-6
        moved = hypot(*inputs.state.velocity_enu_m_s) * for_s > _FROZEN_M
        turned = hypot(*inputs.state.rate_flu_rad_s) * for_s > _FROZEN_RAD
        return self._told_us if moved or turned else None


def battery_below(battery: BatteryState | None, charge: float, voltage_v: float) -> bool:
    """Whether a battery has less than a part of its charge, or than a voltage where that is not 0."""
    return battery is not None and (battery.remaining < charge or battery.voltage_v < voltage_v)


def needs_position(mode: Mode, setpoint: OffboardSetpoint | None) -> bool:
    """Whether a vehicle that flies `mode`, by `setpoint` if that is offboard, must know where it is."""
    return mode not in PLACELESS and not (mode is Mode.OFFBOARD and isinstance(setpoint, AttitudeSetpoint))


def knows_position(estimate: Estimate | None, limits: Limits) -> bool:
    """Whether position and velocity are known within their limits; a state that is told is."""
    if estimate is None:
        return True
    position_m, velocity_m_s = max(estimate.position_std_m[:2]), max(estimate.velocity_std_m_s[:2])
    return position_m <= limits["COM_POS_FS_EPH"] and velocity_m_s <= limits["COM_VEL_FS_EVH"]


def resting_place(state: VehicleState, pace: Pace) -> Vector:
    """Return where the vehicle comes to rest if it brakes from now on, as hard as it may, m, ENU."""
    (x, y, z), (vx, vy, vz) = state.position_enu_m, state.velocity_enu_m_s
    speed = hypot(vx, vy)
    along_s = stopping_m(speed, pace.acceleration_m_s2, pace.jerk_m_s3) / speed if speed > 0.0 else 0.0
    up_s = stopping_m(abs(vz), pace.lift_m_s2, pace.jerk_m_s3) / abs(vz) if vz != 0.0 else 0.0
    return (x + vx * along_s, y + vy * along_s, z + vz * up_s)


def stopping_m(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Return the distance to rest from a steady speed with acceleration and jerk bounded.

    The acceleration rises to its bound and back, a trapezoid; at low speeds a triangle, that never comes to the bound.
    """
    if speed_m_s >= acceleration_m_s2**2 / jerk_m_s3:
        return 0.5 * speed_m_s * (speed_m_s / acceleration_m_s2 + acceleration_m_s2 / jerk_m_s3)
    return speed_m_s * sqrt(speed_m_s / jerk_m_s3)


def _attitude_lost(inputs: FailsafeInputs, limits: Limits) -> bool:
    del limits
    return inputs.estimate is not None and not inputs.estimate.health.attitude


def _tilted(inputs: FailsafeInputs, limits: Limits) -> bool:
    roll, pitch, _ = map(abs, inputs.state.euler)
    return roll > radians(limits["FD_FAIL_R"]) or pitch > radians(limits["FD_FAIL_P"])


def _rotor_failed(inputs: FailsafeInputs, limits: Limits) -> bool:
    del limits
    return inputs.rotor_lost is not None


def _position_lost(inputs: FailsafeInputs, limits: Limits) -> bool:
    return needs_position(inputs.mode, inputs.setpoint) and not knows_position(inputs.estimate, limits)


def _estimate_invalid(inputs: FailsafeInputs, limits: Limits) -> bool:
    del limits
    if inputs.estimate is None:
        return False
    health = inputs.estimate.health
    return not (health.heading and health.height and health.vertical_velocity)


def _battery(charge: str, voltage: str) -> Callable[[FailsafeInputs, Limits], bool]:
    return lambda inputs, limits: battery_below(inputs.battery, limits[charge], limits[voltage])


def _fence_breached(inputs: FailsafeInputs, limits: Limits) -> bool:
    if inputs.fence is None or inputs.standing:
        return False
    margin_m = limits["GF_MARGIN"]
    if inputs.fence(inputs.state.position_enu_m) < margin_m:
        return True
    return limits["GF_PREDICT"] != 0 and inputs.fence(resting_place(inputs.state, inputs.pace)) < margin_m


def _plan_failed(inputs: FailsafeInputs, limits: Limits) -> bool:
    del limits
    return inputs.decided is not None and inputs.decided.fallback in _PLANLESS


def _late(inputs: FailsafeInputs, limits: Limits) -> bool:
    del limits
    return inputs.late


_LOOKS: tuple[tuple[Condition, Callable[[FailsafeInputs, Limits], bool]], ...] = (
    (Condition.ATTITUDE_LOST, _attitude_lost),
    (Condition.TILTED, _tilted),
    (Condition.ROTOR_FAILED, _rotor_failed),
    (Condition.POSITION_LOST, _position_lost),
    (Condition.ESTIMATE_INVALID, _estimate_invalid),
    (Condition.BATTERY_EMERGENCY, _battery("BAT_EMERGEN_THR", "BAT_EMERGEN_VOLT")),
    (Condition.BATTERY_CRITICAL, _battery("BAT_CRIT_THR", "BAT_CRIT_VOLT")),
    (Condition.BATTERY_LOW, _battery("BAT_LOW_THR", "BAT_LOW_VOLT")),
    (Condition.FENCE_BREACHED, _fence_breached),
    (Condition.PLAN_FAILED, _plan_failed),
    (Condition.DEADLINE_MISSED, _late),
)
"""What holds since the first sample that says so."""


def _missed_since(inputs: FailsafeInputs, held: bool) -> int | None:
    del held
    return inputs.missed_us


def _gps_lost_since(inputs: FailsafeInputs, held: bool) -> int | None:
    del held
    return None if inputs.estimate is None else inputs.estimate.health.gps_lost_since_us


def _station_silent_since(inputs: FailsafeInputs, held: bool) -> int | None:
    del held
    return inputs.station_us


def _sticks_silent_since(inputs: FailsafeInputs, held: bool) -> int | None:
    if inputs.mode not in MANUAL and not held:
        return None
    return inputs.listening_us if inputs.sticks_us is None else inputs.sticks_us


def _setpoints_silent_since(inputs: FailsafeInputs, held: bool) -> int | None:
    if inputs.mode is not Mode.OFFBOARD and not held:
        return None
    return inputs.listening_us if inputs.setpoint is None else inputs.setpoint.time_us


_AGES: tuple[tuple[Condition, Callable[[FailsafeInputs, bool], int | None]], ...] = (
    (Condition.TELEMETRY_MISSED, _missed_since),
    (Condition.GPS_LOST, _gps_lost_since),
    (Condition.STATION_LOST, _station_silent_since),
    (Condition.STICKS_LOST, _sticks_silent_since),
    (Condition.SETPOINTS_LOST, _setpoints_silent_since),
)
"""What holds since a moment that is known: a source has been silent since then. They take whether it is lost already.

A stream that is not asked for any more stays lost until it is heard again.
"""
