"""The state of a live vehicle from its messages."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from math import isfinite, isnan, nan, pi
from typing import Any

import numpy as np

from colibri.common.earth.geodesy import Geodetic, enu_of, geodetic_of
from colibri.common.rotations import quaternion_from_euler, tilt_deg
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.client.modes import mode_name
from colibri.mavlink.wire.dialect import Message, mav, rotors_of
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu, ned_from_enu
from colibri.view.snapshot import NO_POINTS, NOWHERE, Chart, Snapshot

CHART_S = 60.0
TRAIL_POINTS = 600
TEXTS = 4
_ROW_S = 0.1
_STALE_S = 3.0  # age from which values are hidden
_PULSE_US = (1000.0, 2000.0)
_E7 = 1e7
_USUAL_ROTORS, _MOST_ROTORS = 4, 8
_ROTORS = "rotors, % of the largest"
_ROTOR_LIMITS = {"(stopped)": 0.0, "(largest)": 100.0}
_CHARTS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("position error, m", ("error",)),
    ("tilt, deg", ("tilt",)),
    (_ROTORS, ("1", "2", "3", "4", "5", "6", "7", "8")),
    ("active constraints", ("rotors", "increments", "angles", "rates")),
    ("QP time, ms", ("QP",)),
    ("estimated accuracy, m", ("horizontal", "vertical")),
    ("battery, V", ("voltage",)),
)


class Telemetry:
    """The latest state; `system` and `rotors` are 0 before the first heartbeat."""

    def __init__(self) -> None:
        self.rotors = 0
        self.autopilot: int | None = None
        self.system = 0
        self.origin: Geodetic | None = None
        self.home_enu_m: Vector = NOWHERE
        self._has_local = False
        self._now = Snapshot(time_s=0.0, position_enu_m=NOWHERE, attitude=(1.0, 0.0, 0.0, 0.0))
        self._trail: deque[Vector] = deque(maxlen=TRAIL_POINTS)
        self._texts: deque[str] = deque(maxlen=TEXTS)
        self._values: dict[str, tuple[float, Any]] = {}
        self._rows: deque[tuple[float, ...]] = deque(maxlen=round(CHART_S / _ROW_S))
        self._began_s = self._moved_s = nan

    def receive(self, message: Message, now_s: float) -> None:
        if isnan(self._began_s):
            self._began_s = now_s
        fields = message.fields
        match message.name:
            case "HEARTBEAT":
                self.autopilot = int(fields.autopilot)
                self.rotors = self.rotors or rotors_of(fields.type) or _USUAL_ROTORS
                self._set("armed", now_s, bool(fields.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED))
                self._set("mode", now_s, mode_name(self.autopilot, fields.custom_mode))
            case "LOCAL_POSITION_NED":
                self._has_local = True
                place, velocity = (fields.x, fields.y, fields.z), (fields.vx, fields.vy, fields.vz)
                self._moved(ned_from_enu(place), ned_from_enu(velocity), now_s)
            case "GLOBAL_POSITION_INT":
                self._global_position(fields, now_s)
            case "GPS_GLOBAL_ORIGIN":
                self.origin = _geodetic(fields)
            case "HOME_POSITION" if self.origin is not None:
                self.home_enu_m = enu_of(_geodetic(fields), self.origin)
            case "ATTITUDE_QUATERNION":
                attitude: Quaternion = ned_frd_from_enu_flu((fields.q1, fields.q2, fields.q3, fields.q4))
                self._now = replace(self._now, attitude=attitude)
            case "ATTITUDE":
                attitude = quaternion_from_euler(fields.roll, -fields.pitch, pi / 2.0 - fields.yaw)
                self._now = replace(self._now, attitude=attitude)
            case "POSITION_TARGET_LOCAL_NED":
                self._target(fields, now_s)
            case "SERVO_OUTPUT_RAW":
                pulses = [getattr(fields, f"servo{rotor}_raw") for rotor in range(1, self.rotors + 1)]
                self._pulses(pulses, now_s)
            case "ACTUATOR_OUTPUT_STATUS":
                self._pulses(fields.actuator[: self.rotors], now_s)
            case "TRAJECTORY_REPRESENTATION_WAYPOINTS":
                rows = zip(fields.pos_x, fields.pos_y, fields.pos_z, strict=True)
                points = [ned_from_enu(row) for row in islice(rows, min(fields.valid_points, 5))]
                self._set("horizon", now_s, np.array([self._now.position_enu_m, *points]))
            case "DEBUG_FLOAT_ARRAY" if fields.name == "lpv_mpc":
                self._set("solver", now_s, (fields.data[3] / 1e3, *fields.data[7:11]))
            case "ESTIMATOR_STATUS":
                self._set("accuracy", now_s, (fields.pos_horiz_accuracy, fields.pos_vert_accuracy))
            case "BATTERY_STATUS":
                cells = [cell for cell in fields.voltages if cell not in (0, 0xFFFF)]
                if cells:
                    self._set("volts", now_s, sum(cells) / 1e3)
            case "WIND_COV":
                self._set("wind", now_s, (fields.wind_y, fields.wind_x, -fields.wind_z))
            case "STATUSTEXT":
                self.say(fields.text)

    def say(self, text: str) -> None:
        self._texts.appendleft(text)

    def snapshot(self, now_s: float) -> Snapshot:
        """Return the known state; at the origin without a position."""
        now = self._now
        place = now.position_enu_m if all(map(isfinite, now.position_enu_m)) else (0.0, 0.0, 0.0)
        volts = self._fresh("volts", now_s, nan)
        return Snapshot(
            time_s=0.0 if isnan(self._began_s) else now_s - self._began_s,
            position_enu_m=place,
            attitude=now.attitude,
            velocity_enu_m_s=now.velocity_enu_m_s,
            rotors=self._fresh("rotors", now_s, (nan,) * (self.rotors or _USUAL_ROTORS)),
            reference_enu_m=self._reference() if now_s - self._moved_s < _STALE_S else NOWHERE,
            trail=np.array([*self._trail]) if self._trail else NO_POINTS,
            horizon=self._fresh("horizon", now_s, NO_POINTS),
            wind_enu_m_s=self._fresh("wind", now_s, NOWHERE),
            mode=self._fresh("mode", now_s, "no heartbeat"),
            armed=self._fresh("armed", now_s, None),
            battery="" if isnan(volts) else f"{volts:.2f} V",
            texts=tuple(self._texts),
        )

    def charts(self) -> tuple[Chart, ...]:
        """Return the charts of the last minute."""
        if len(self._rows) < 2:
            return ()
        rows = np.array(self._rows)
        charts, at = [], 1
        for title, names in _CHARTS:
            values = rows[:, at : at + len(names)]
            at += len(names)
            if title == _ROTORS:
                names, values = names[: self.rotors], values[:, : self.rotors]
            known = np.isfinite(values).all(axis=1)
            if known.sum() > 1:
                shown = values[known]
                limits = _ROTOR_LIMITS if title == _ROTORS else {}
                lines = np.broadcast_to([*limits.values()], (len(shown), len(limits)))
                drawn = np.hstack([shown, lines]).T
                charts.append(Chart(title, (*names, *limits), rows[known, 0] - self._began_s, drawn, shown.max(axis=1)))
        return tuple(charts)

    def place_of(self, latitude_deg: float, longitude_deg: float, up_m: float, *, above_sea: bool) -> Vector:
        """Convert a place to ENU; nan without an origin."""
        if self.origin is None:
            return NOWHERE
        east, north, _ = enu_of(Geodetic(latitude_deg, longitude_deg, self.origin.altitude_m), self.origin)
        home_up = 0.0 if isnan(self.home_enu_m[2]) else self.home_enu_m[2]
        return east, north, up_m - self.origin.altitude_m if above_sea else up_m + home_up

    def _fresh(self, name: str, now_s: float, otherwise: Any) -> Any:
        said_s, value = self._values.get(name, (-_STALE_S, otherwise))
        return value if now_s - said_s < _STALE_S else otherwise

    def _set(self, name: str, now_s: float, value: Any) -> None:
        self._values[name] = (now_s, value)

    def _reference(self) -> Vector:
        said_s, (place, velocity) = self._values.get("reference", (-_STALE_S, (NOWHERE, NOWHERE)))
        age_s = self._moved_s - said_s
        x, y, z = np.add(place, np.multiply(age_s, velocity)).tolist()
        return (x, y, z) if age_s < _STALE_S else NOWHERE

    def _moved(self, place: Vector, velocity: Vector, now_s: float) -> None:
        self._now = replace(self._now, position_enu_m=place, velocity_enu_m_s=velocity)
        self._trail.append(place)
        self._moved_s = now_s
        if not self._rows or now_s - self._rows[-1][0] >= _ROW_S:
            self._rows.append(self._row(place, now_s))

    def _row(self, place: Vector, now_s: float) -> tuple[float, ...]:
        error = float(np.linalg.norm(np.subtract(place, self._reference())))
        rotors = [100.0 * part for part in self._fresh("rotors", now_s, ())]
        rotors += [nan] * (_MOST_ROTORS - len(rotors))
        solver = self._fresh("solver", now_s, (nan,) * 5)
        accuracy = self._fresh("accuracy", now_s, (nan, nan))
        tilt = tilt_deg(self._now.attitude)
        return (now_s, error, tilt, *rotors, *solver[1:], solver[0], *accuracy, self._fresh("volts", now_s, nan))

    def _global_position(self, fields: Any, now_s: float) -> None:
        place = Geodetic(fields.lat / _E7, fields.lon / _E7, fields.alt / 1e3)
        if self.origin is None and (fields.lat or fields.lon):
            here = self._now.position_enu_m
            back = (0.0, 0.0, 0.0) if any(map(isnan, here)) else (-here[0], -here[1], -here[2])
            self.origin = geodetic_of(back, place)
        if not self._has_local and self.origin is not None:
            velocity = (fields.vy / 100.0, fields.vx / 100.0, -fields.vz / 100.0)
            self._moved(enu_of(place, self.origin), velocity, now_s)

    def _target(self, fields: Any, now_s: float) -> None:
        if all(map(isfinite, (fields.x, fields.y, fields.z))) and not fields.type_mask & 0b111:
            moves = not fields.type_mask & 0b111000 and all(map(isfinite, (fields.vx, fields.vy, fields.vz)))
            velocity = ned_from_enu((fields.vx, fields.vy, fields.vz)) if moves else (0.0, 0.0, 0.0)
            self._set("reference", now_s, (ned_from_enu((fields.x, fields.y, fields.z)), velocity))

    def _pulses(self, pulses: Sequence[float], now_s: float) -> None:
        low, high = _PULSE_US
        if any(pulses):
            parts = tuple(min(max((pulse - low) / (high - low), 0.0), 1.0) for pulse in pulses)
            self._set("rotors", now_s, parts)


def _geodetic(fields: Any) -> Geodetic:
    return Geodetic(fields.latitude / _E7, fields.longitude / _E7, fields.altitude / 1e3)


INTERVALS_US: dict[str, int] = {
    **dict.fromkeys(("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED"), 40_000),
    **dict.fromkeys(("POSITION_TARGET_LOCAL_NED", "SERVO_OUTPUT_RAW"), 100_000),
    **dict.fromkeys(("TRAJECTORY_REPRESENTATION_WAYPOINTS", "DEBUG_FLOAT_ARRAY"), 100_000),
    **dict.fromkeys(("GLOBAL_POSITION_INT", "ESTIMATOR_STATUS", "BATTERY_STATUS", "WIND_COV"), 500_000),
    **dict.fromkeys(("GPS_GLOBAL_ORIGIN", "HOME_POSITION"), 2_000_000),
}
"""Messages to request, with their intervals."""
