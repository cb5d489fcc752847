"""When each failsafe condition began, by simulated time."""

from collections.abc import Callable, Container, Mapping
from math import hypot, radians, sqrt

from colibri.autopilot.commander.rules.failsafe_parameters import Limits
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import MANUAL, Mode
from colibri.autopilot.control.interface import Diagnostics, Fallback, VehicleState
from colibri.autopilot.estimation.estimate import Estimate, Health
from colibri.autopilot.estimation.sensing.rejection import RejectedSource
from colibri.autopilot.guidance.integrator_chain import Limits as Pace
from colibri.common.records import Record
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, OffboardSetpoint
from colibri.mavlink.telemetry.snapshot import BatteryState

NEVER_US = -(10**12)  # start of listening for clients without a restart
PLACELESS = (Mode.STABILIZED, Mode.ALTITUDE)  # modes without a need for position
_FROZEN_M, _FROZEN_RAD = 0.05, 0.05  # motion by the rates beyond which an unchanged state is a fault
_PLANLESS = (Fallback.SHIFTED_PLAN, Fallback.LQR, Fallback.DESCENT)
"""Fallbacks after an unsolved QP; recovery is one if a QP was tried."""


class FailsafeInputs(Record, frozen=True):
    """Inputs of the conditions; times are simulated, µs."""

    now_us: int
    missed_us: int | None  # last frame before a gap
    state: VehicleState
    mode: Mode
    standing: bool
    estimate: Estimate | None
    setpoint: OffboardSetpoint | None
    sticks_us: int | None
    listening_us: int  # start of listening for clients, by default the restart
    station_us: int | None
    battery: BatteryState | None
    fence: Callable[[Vector], float] | None  # returns a place's distance inside every fence, m
    decided: Diagnostics | None  # diagnostics while the control law is active
    late: bool  # whether the declared solve time exceeds a control sample
    rotor_lost: int | None  # index of a failed rotor, if the vehicle must land
    pace: Pace
    needs_radio: bool = False  # whether sticks are required in every mode
    exempt: Mapping[Condition, str] = {}  # reported only, with what continues; without effect if that is empty
    caught: bool = False  # found falling: the attitude is still being found


class Conditions:
    def __init__(self) -> None:
        self._since_us: dict[Condition, int] = {}
        self._position: Vector | None = None
        self._attitude: Quaternion | None = None
        self._pose_us = 0

    def look(self, inputs: FailsafeInputs, limits: Limits, held: Container[Condition]) -> Mapping[Condition, int]:
        """Return when each holding condition began; `held` ones were lost before."""
        before, self._since_us = self._since_us, {}
        found: dict[Condition, int] = {}
        for condition, silent_since in SILENT_SINCE.items():
            since_us = silent_since(inputs, condition in held)
            if since_us is not None:
                found[condition] = since_us
        for condition, holds in (HOLDS_ON_STATE if inputs.estimate is None else HOLDS).items():
            if holds(inputs, limits):
                found[condition] = self._since_us[condition] = before.get(condition, inputs.now_us)
        if inputs.estimate is not None and inputs.estimate.health.any_lost:
            for condition, lost in SENSORS.items():
                if lost(inputs.estimate.health):
                    found[condition] = self._since_us[condition] = before.get(condition, inputs.now_us)
        for condition, continues in inputs.exempt.items():
            if not continues:
                found.pop(condition, None)
        frozen_us = self._frozen_since(inputs)
        if frozen_us is not None:
            found[Condition.ATTITUDE_LOST] = frozen_us
        return found

    def _frozen_since(self, inputs: FailsafeInputs) -> int | None:
        state, now_us = inputs.state, inputs.now_us
        if state.position_enu_m != self._position or state.attitude != self._attitude or inputs.standing:
            self._position, self._attitude, self._pose_us = state.position_enu_m, state.attitude, now_us
            return None
        for_s = (now_us - self._pose_us) * 1e-6
        moved = hypot(*state.velocity_enu_m_s) * for_s > _FROZEN_M
        turned = hypot(*state.rate_flu_rad_s) * for_s > _FROZEN_RAD
        return self._pose_us if moved or turned else None


def battery_below(battery: BatteryState | None, charge: float, voltage_v: float) -> bool:
    """Check charge and voltage; a limit of 0 V is off."""
    return battery is not None and (battery.remaining < charge or battery.voltage_v < voltage_v)


def needs_position(mode: Mode, setpoint: OffboardSetpoint | None) -> bool:
    return mode not in PLACELESS and not (mode is Mode.OFFBOARD and isinstance(setpoint, AttitudeSetpoint))


def position_known(estimate: Estimate | None, limits: Limits) -> bool:
    if estimate is None:
        return True
    position_m, velocity_m_s = max(estimate.position_std_m[:2]), max(estimate.velocity_std_m_s[:2])
    return position_m <= limits["COM_POS_FS_EPH"] and velocity_m_s <= limits["COM_VEL_FS_EVH"]


def resting_place(state: VehicleState, pace: Pace) -> Vector:
    """Return the position after braking as hard as allowed, m, ENU."""
    (x, y, z), (vx, vy, vz) = state.position_enu_m, state.velocity_enu_m_s
    speed = hypot(vx, vy)
    along_s = stopping_m(speed, pace.acceleration_m_s2, pace.jerk_m_s3) / speed if speed > 0.0 else 0.0
    up_s = stopping_m(abs(vz), pace.lift_m_s2, pace.jerk_m_s3) / abs(vz) if vz != 0.0 else 0.0
    return (x + vx * along_s, y + vy * along_s, z + vz * up_s)


def stopping_m(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Return the braking distance with bounded acceleration and jerk."""
    if speed_m_s >= acceleration_m_s2**2 / jerk_m_s3:
        return 0.5 * speed_m_s * (speed_m_s / acceleration_m_s2 + acceleration_m_s2 / jerk_m_s3)
    return speed_m_s * sqrt(speed_m_s / jerk_m_s3)


def _estimate_invalid(inputs: FailsafeInputs, _limits: Limits) -> bool:
    if inputs.estimate is None:
        return False
    health = inputs.estimate.health
    return not (health.heading and health.height and health.vertical_velocity)


def _tilted(inputs: FailsafeInputs, limits: Limits) -> bool:
    roll, pitch, _ = inputs.state.euler
    return abs(roll) > radians(limits["FD_FAIL_R"]) or abs(pitch) > radians(limits["FD_FAIL_P"])


def _fence_breached(inputs: FailsafeInputs, limits: Limits) -> bool:
    if inputs.fence is None or inputs.standing:
        return False
    margin_m = limits["GF_MARGIN"]
    if inputs.fence(inputs.state.position_enu_m) < margin_m:
        return True
    return limits["GF_PREDICT"] != 0 and inputs.fence(resting_place(inputs.state, inputs.pace)) < margin_m


def _battery(charge: str, voltage: str) -> Callable[[FailsafeInputs, Limits], bool]:
    return lambda inputs, limits: battery_below(inputs.battery, limits[charge], limits[voltage])


def _lacks_plan(decided: Diagnostics) -> bool:
    if decided.fallback is Fallback.RECOVERY:
        return decided.qp_status is not None
    return decided.fallback in _PLANLESS


HOLDS: Mapping[Condition, Callable[[FailsafeInputs, Limits], bool]] = {
    Condition.ATTITUDE_LOST: lambda inputs, _: (
        inputs.estimate is not None and not (inputs.estimate.health.attitude or inputs.caught)
    ),
    Condition.TILTED: _tilted,
    Condition.ROTOR_FAILED: lambda inputs, _: inputs.rotor_lost is not None,
    Condition.POSITION_LOST: lambda inputs, limits: (
        not position_known(inputs.estimate, limits) and needs_position(inputs.mode, inputs.setpoint)
    ),
    Condition.ESTIMATE_INVALID: _estimate_invalid,
    Condition.BATTERY_EMERGENCY: _battery("BAT_EMERGEN_THR", "BAT_EMERGEN_VOLT"),
    Condition.BATTERY_CRITICAL: _battery("BAT_CRIT_THR", "BAT_CRIT_VOLT"),
    Condition.BATTERY_LOW: _battery("BAT_LOW_THR", "BAT_LOW_VOLT"),
    Condition.FENCE_BREACHED: _fence_breached,
    Condition.PLAN_FAILED: lambda inputs, _: inputs.decided is not None and _lacks_plan(inputs.decided),
    Condition.DEADLINE_MISSED: lambda inputs, _: inputs.late,
}
"""Conditions that begin with the first sample at which they hold."""

_OF_ESTIMATE = (Condition.ATTITUDE_LOST, Condition.POSITION_LOST, Condition.ESTIMATE_INVALID)
HOLDS_ON_STATE = {condition: holds for condition, holds in HOLDS.items() if condition not in _OF_ESTIMATE}


SENSORS: Mapping[Condition, Callable[[Health], bool]] = {
    Condition.GYROSCOPE_LOST: lambda health: not health.gyroscope,
    Condition.ACCELEROMETER_LOST: lambda health: not health.accelerometer,
    Condition.BAROMETER_LOST: lambda health: RejectedSource.BAROMETER in health.not_accepted,
    Condition.MAGNETOMETER_LOST: lambda health: RejectedSource.MAGNETOMETER in health.not_accepted,
}
"""Sensors that have failed; GPS is silent instead."""


def _sticks_silent_since(inputs: FailsafeInputs, held: bool) -> int | None:
    if inputs.mode not in MANUAL and not (held or inputs.needs_radio):
        return None
    return inputs.listening_us if inputs.sticks_us is None else inputs.sticks_us


def _setpoints_silent_since(inputs: FailsafeInputs, held: bool) -> int | None:
    if inputs.mode is not Mode.OFFBOARD and not held:
        return None
    return inputs.listening_us if inputs.setpoint is None else inputs.setpoint.time_us


SILENT_SINCE: Mapping[Condition, Callable[[FailsafeInputs, bool], int | None]] = {
    Condition.TELEMETRY_MISSED: lambda inputs, _: inputs.missed_us,
    Condition.GPS_LOST: lambda inputs, _: None if inputs.estimate is None else inputs.estimate.health.gps_lost_since_us,
    Condition.STATION_LOST: lambda inputs, _: inputs.station_us,
    Condition.STICKS_LOST: _sticks_silent_since,
    Condition.SETPOINTS_LOST: _setpoints_silent_since,
}
"""Start of a source's silence; a stream that is already lost stays so until received again."""
