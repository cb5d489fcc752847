"""A vehicle's reports: mode, arming, battery, estimator, fence, home."""

from dataclasses import dataclass, field
from math import nan
from typing import Any

from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.wire.dialect import MODE_ARMED, Message, bits, mav, sequence_of

_OLDER_FROM = 128  # a sequence number this far ahead, of 256, belongs to an older, delayed message
_AIRBORNE = frozenset({mav.MAV_LANDED_STATE_IN_AIR, mav.MAV_LANDED_STATE_TAKEOFF, mav.MAV_LANDED_STATE_LANDING})
_ESTIMATES = bits("ESTIMATOR_", "ATTITUDE VELOCITY_HORIZ VELOCITY_VERT")
_PLACES = bits("ESTIMATOR_", "POS_HORIZ_REL POS_HORIZ_ABS")
_HEIGHTS = bits("ESTIMATOR_", "POS_VERT_ABS POS_VERT_AGL")
_PREARM: int = mav.MAV_SYS_STATUS_PREARM_CHECK
_AHRS: int = mav.MAV_SYS_STATUS_AHRS
_FENCE: int = mav.MAV_SYS_STATUS_GEOFENCE
_PERCENT = 100.0
_MM = 1e-3
_DEGREES = 1e-7
_UNKNOWN_LANDED: int = mav.MAV_LANDED_STATE_UNDEFINED


@dataclass
class VehicleReport:
    autopilot: int = -1  # MAV_AUTOPILOT
    mode: int = -1  # `custom_mode`
    mode_reports_us: list[int] = field(default_factory=list)
    armed: bool = False
    system_status: int = 0  # MAV_STATE
    landed_state: int = _UNKNOWN_LANDED  # MAV_LANDED_STATE
    battery: float = nan  # remaining charge, 0..1
    estimator_ok: bool | None = None  # attitude, velocity and position are estimated
    prearm_ok: bool | None = None  # arming checks pass
    fence_breached: bool = False
    altitude_amsl_m: float = nan
    home: Geodetic | None = None
    origin: Geodetic | None = None  # of its local frame
    texts: list[str] = field(default_factory=list)
    reported_us: dict[str, int] = field(default_factory=dict)  # of the last report, by its subject
    _told: int = 0
    _sequence: int | None = None
    _tells_estimates: bool = False

    @property
    def airborne(self) -> bool | None:
        return None if self.landed_state == _UNKNOWN_LANDED else self.landed_state in _AIRBORNE

    def take_new_texts(self) -> list[str]:
        new, self._told = self.texts[self._told :], len(self.texts)
        return new

    def mode_rate_hz(self, now_us: int) -> float:
        return float(sum(1 for at_us in self.mode_reports_us if now_us - at_us <= 1_000_000))

    def receive(self, message: Message, now_us: int) -> None:
        fields, newest = message.fields, self._is_newest(message)
        match message.name:
            case "HEARTBEAT":
                self.autopilot = fields.autopilot
                self.system_status = fields.system_status
                self.reported_us["heartbeat"] = now_us
                if newest:
                    self.armed = bool(fields.base_mode & MODE_ARMED)
                    self._set_mode(fields.custom_mode, now_us)
            case "CURRENT_MODE" if newest:
                self._set_mode(fields.custom_mode, now_us)
            case "EXTENDED_SYS_STATE":
                self.landed_state, self.reported_us["landed"] = fields.landed_state, now_us
            case "SYS_STATUS":
                self._take_status(fields, now_us)
            case "BATTERY_STATUS":
                self._take_battery(fields, now_us)
            case "ESTIMATOR_STATUS":
                self._tells_estimates, self.reported_us["estimator"] = True, now_us
                known = [fields.flags & each for each in (_ESTIMATES, _PLACES, _HEIGHTS)]
                self.estimator_ok = known[0] == _ESTIMATES and all(known)
            case "GLOBAL_POSITION_INT":
                self.altitude_amsl_m, self.reported_us["altitude"] = fields.alt * _MM, now_us
            case "HOME_POSITION":
                self.home = _geodetic(fields)
            case "GPS_GLOBAL_ORIGIN":
                self.origin = _geodetic(fields)
            case "STATUSTEXT":
                self.texts.append(fields.text)

    def _set_mode(self, mode: int, now_us: int) -> None:
        self.mode = mode
        self.reported_us["mode"] = now_us
        self.mode_reports_us = [at_us for at_us in self.mode_reports_us if now_us - at_us < 1_000_000] + [now_us]

    def _is_newest(self, message: Message) -> bool:
        sequence = sequence_of(message.frame)
        if self._sequence is not None and (sequence - self._sequence) % 256 >= _OLDER_FROM:
            return False
        self._sequence = sequence
        return True

    def _take_status(self, fields: Any, now_us: int) -> None:
        self.reported_us["status"] = now_us
        if fields.onboard_control_sensors_present & _PREARM:
            self.prearm_ok = bool(fields.onboard_control_sensors_health & _PREARM)
        if not self._tells_estimates and fields.onboard_control_sensors_present & _AHRS:
            self.estimator_ok = bool(fields.onboard_control_sensors_health & _AHRS)
            self.reported_us["estimator"] = now_us
        watched = fields.onboard_control_sensors_enabled & _FENCE
        self.fence_breached = bool(watched) and not fields.onboard_control_sensors_health & _FENCE
        self._take_battery(fields, now_us)

    def _take_battery(self, fields: Any, now_us: int) -> None:
        if fields.battery_remaining >= 0:
            self.battery, self.reported_us["battery"] = fields.battery_remaining / _PERCENT, now_us


def _geodetic(fields: Any) -> Geodetic:
    return Geodetic(fields.latitude * _DEGREES, fields.longitude * _DEGREES, fields.altitude * _MM)
