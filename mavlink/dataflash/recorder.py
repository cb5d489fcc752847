"""A recorder of the vehicle's snapshots, texts and parameters as DataFlash."""

from collections.abc import Callable
from contextlib import suppress
from math import degrees, hypot, nan, pi
from typing import TypeAlias

from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.kernels import atan2
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.dataflash.messages import Value, beginning, message
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.telemetry.encoder import STANDARD_GRAVITY_M_S2, compass_cdeg, in_body_frd
from colibri.mavlink.telemetry.position import DILUTION_E2, SATELLITES
from colibri.mavlink.telemetry.power import actuator_control_target
from colibri.mavlink.telemetry.snapshot import CHARGE_OK, TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_from_enu

EVERY_US = 40_000  # interval of attitude, control and motors: 25 Hz, as at ArduCopter's default LOG_BITMASK
SLOW_EVERY_US = 200_000  # interval of position fixes and the battery

_GPS_EPOCH_US = 315_964_800_000_000 - 18_000_000  # Unix time of 1980-01-06, less the leap seconds since
_WEEK_MS = 7 * 24 * 3_600_000
_EKF_ORIGIN, _HOME = 0, 1  # of ORGN
_ARMED, _DISARMED, _LAND_COMPLETE, _NOT_LANDED = 10, 11, 18, 28  # of EV
_BATTERY, _FENCE, _GPS_GLITCH = 6, 9, 11  # subsystems of ERR
_OUTPUTS = 14


_Row: TypeAlias = Callable[[TelemetrySnapshot], tuple[Value, ...]]  # returns the fields after the time


class DataFlashRecorder:
    """Writes snapshots to a log of ArduPilot's format."""

    def __init__(
        self, write: Callable[[bytes], None], parameters: Parameters, banner: str, boot_unix_us: int = 0
    ) -> None:
        """Record into `write`; readers recognize the vehicle by `banner`, "ArduCopter V4.7.0"."""
        self._write, self._parameters, self._banner, self._boot_unix_us = write, parameters, banner, boot_unix_us
        self._rows = ((EVERY_US, _ROWS), (SLOW_EVERY_US, {"POS": _place, "GPS": self._fix, "BAT": _battery}))
        self._before: TelemetrySnapshot | None = None
        self._revision, self._values = 0, dict(parameters.values)

    def begin(self) -> bytes:
        self._before = None
        self._revision, self._values = self._parameters.revision, dict(self._parameters.values)
        parameters = [self._parameter(0, name) for name in self._values]
        return b"".join([beginning(0), message("MSG", 0, self._banner), *parameters])

    def update(self, s: TelemetrySnapshot) -> None:
        before, self._before = self._before, s
        now_us = s.time_us
        if self._parameters.revision != self._revision:
            known, self._values = self._values, dict(self._parameters.values)
            self._revision = self._parameters.revision
            for name in [name for name, value in self._values.items() if known.get(name) != value]:
                self._write(self._parameter(now_us, name))
        self._events(s, before)
        for every_us, rows in self._rows:
            if before is None or now_us // every_us != before.time_us // every_us:
                for name, row in rows.items():
                    self._add_row(name, row, s)

    def say(self, time_us: int, _severity: int, text: str) -> None:
        self._write(message("MSG", time_us, text))

    def flush(self) -> None: ...

    def _parameter(self, time_us: int, name: str) -> bytes:
        return message("PARM", time_us, name, self._values[name], self._parameters.default(name))

    def _events(self, s: TelemetrySnapshot, before: TelemetrySnapshot | None) -> None:
        def changed(fact: Callable[[TelemetrySnapshot], object], at_first: object) -> bool:
            return fact(s) != (at_first if before is None else fact(before))

        now_us = s.time_us
        if changed(lambda each: each.origin, None):
            self._add("ORGN", now_us, _EKF_ORIGIN, *s.origin)
        if s.home is not None and changed(lambda each: each.home, None):
            place = s._replace(position_enu_m=s.home.position_enu_m).place
            self._add("ORGN", now_us, _HOME, *place)
        if changed(lambda each: each.custom_mode, None):
            self._add("MODE", now_us, s.custom_mode & 0xFF, s.custom_mode & 0xFF, 0)
        if changed(lambda each: each.armed, False):
            self._add("ARM", now_us, s.armed, 0, 0, 0)
            self._add("EV", now_us, _ARMED if s.armed else _DISARMED)
        if changed(_is_landed, True):
            self._add("EV", now_us, _LAND_COMPLETE if _is_landed(s) else _NOT_LANDED)
        for subsystem, failed in _FAILURES.items():
            if changed(failed, False):
                self._add("ERR", now_us, subsystem, failed(s))

    def _fix(self, s: TelemetrySnapshot) -> tuple[Value, ...]:
        week = week_ms = 0
        if self._boot_unix_us:
            week, week_ms = divmod((self._boot_unix_us + s.time_us - _GPS_EPOCH_US) // 1000, _WEEK_MS)
        if not s.gps_ok:
            return (0, mav.GPS_FIX_TYPE_NO_FIX, week_ms, week, 0, 99.99, *(0.0,) * 7, False)
        fix = s.fix
        place, (east, north, up) = (s.place, s.velocity_enu_m_s) if fix is None else (fix.place, fix.velocity_enu_m_s)
        kind, seen = (mav.GPS_FIX_TYPE_3D_FIX, SATELLITES) if fix is None else (fix.fix_type, fix.satellites)
        course = compass_cdeg(atan2(north, east)) / 100.0
        return (0, kind, week_ms, week, seen, DILUTION_E2 / 100, *place, hypot(east, north), course, -up, 0.0, True)

    def _add_row(self, name: str, row: _Row, s: TelemetrySnapshot) -> None:
        """Add a row; one without valid numbers is omitted."""
        with suppress(ArithmeticError, ValueError):
            values = row(s)
            if values:
                self._add(name, s.time_us, *values)

    def _add(self, name: str, *values: Value) -> None:
        self._write(message(name, *values))


def _is_landed(s: TelemetrySnapshot) -> bool:
    return bool(s.landed_state == mav.MAV_LANDED_STATE_ON_GROUND)


_FAILURES: dict[int, Callable[[TelemetrySnapshot], bool]] = {
    _BATTERY: lambda s: s.battery is not None and s.battery.charge_state > CHARGE_OK,
    _FENCE: lambda s: s.fence_breached,
    _GPS_GLITCH: lambda s: not s.gps_ok,
}


def _attitude(s: TelemetrySnapshot) -> tuple[Value, ...]:
    wanted, actual = _angles_deg(s.setpoint.attitude), _angles_deg(s.attitude)
    pairs = zip(wanted, actual, strict=True)
    return (*(angle for pair in pairs for angle in pair), 3)  # of the third filter, as ArduCopter's


def _angles_deg(attitude: Quaternion) -> Vector:
    """Return roll, pitch (FRD) and heading."""
    roll, pitch, yaw = euler_from_quaternion(attitude)
    return (degrees(roll), -degrees(pitch), degrees(pi / 2.0 - yaw) % 360.0)


def _rates(s: TelemetrySnapshot) -> tuple[Value, ...]:
    wanted, actual = frd_from_flu(s.setpoint.rate_flu_rad_s), s.rate_frd
    *_, mixed = actuator_control_target(s)
    axes = [(degrees(wanted[axis]), degrees(actual[axis]), mixed[axis]) for axis in range(3)]
    climb = (s.setpoint.acceleration_enu_m_s2[2], s.acceleration_enu_m_s2[2], mixed[3])
    return (*axes[0], *axes[1], *axes[2], *climb)


def _control(s: TelemetrySnapshot) -> tuple[Value, ...]:
    lever = 0.0 if s.sticks is None else s.sticks[2]
    height, climb = s.position_enu_m[2], s.velocity_enu_m_s[2]
    wanted_height, wanted_climb = s.setpoint.position_enu_m[2], s.setpoint.velocity_enu_m_s[2]
    throttle = sum(s.controls) / len(s.controls)
    heights = (wanted_height, height, height, 0.0, 0.0, nan)  # rangefinder and terrain: none
    return (lever, 0.0, throttle, nan, *heights, 100.0 * wanted_climb, 100.0 * climb)


def _position(axis: int) -> _Row:
    def row(s: TelemetrySnapshot) -> tuple[Value, ...]:
        wanted = s.setpoint
        pairs = (
            (wanted.position_enu_m, s.position_enu_m),
            (wanted.velocity_enu_m_s, s.velocity_enu_m_s),
            (wanted.acceleration_enu_m_s2, s.acceleration_enu_m_s2),
        )
        ned = [(ned_from_enu(target)[axis], ned_from_enu(actual)[axis]) for target, actual in pairs]
        return tuple(number for target, actual in ned for number in (target, target, actual))

    return row


def _place(s: TelemetrySnapshot) -> tuple[Value, ...]:
    return (*s.place, s.height_above_home_m, s.position_enu_m[2])


def _battery(s: TelemetrySnapshot) -> tuple[Value, ...]:
    if s.battery is None:
        return ()
    battery = s.battery
    volts = (battery.voltage_v, battery.voltage_v, battery.current_a)
    return (0, *volts, 1e3 * battery.used_ah, battery.used_wh, 0.0, 0.0, 100.0 * battery.remaining, True, 100)


def _motors(s: TelemetrySnapshot) -> tuple[Value, ...]:
    pulses = [1000.0 + 1000.0 * control for control in s.controls]
    return (*pulses, *(0,) * (_OUTPUTS - len(pulses)))


def _inertial(s: TelemetrySnapshot) -> tuple[Value, ...]:
    if s.sensed is None:
        east, north, up = s.acceleration_enu_m_s2
        force, rate = in_body_frd(s.attitude, (east, north, up + STANDARD_GRAVITY_M_S2)), s.rate_frd
    else:
        force, rate = frd_from_flu(s.sensed.specific_force_flu_m_s2), frd_from_flu(s.sensed.rate_flu_rad_s)
    hertz = round(1e6 / EVERY_US)
    return (0, *rate, *force, 0, 0, 0.0, True, True, hertz, hertz)


_ROWS: dict[str, _Row] = {
    "ATT": _attitude,
    "RATE": _rates,
    "CTUN": _control,
    "PSCN": _position(0),
    "PSCE": _position(1),
    "PSCD": _position(2),
    "RCOU": _motors,
    "IMU": _inertial,
}
