"""Sensor frames from plant to autopilot, in SI, ENU/FLU, and their messages of PX4's simulator interface.

Units and frames: https://docs.px4.io/main/en/simulation/. Values are unchecked: an autopilot must cope with broken
ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from math import degrees, hypot, inf, isfinite, nan
from struct import Struct
from typing import Any, NamedTuple, TypeAlias

from colibri.common.earth.atmosphere import altitude_m
from colibri.common.earth.geodesy import Geodetic
from colibri.common.kernels import atan2
from colibri.common.records import Record
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import Codec, Message, mav
from colibri.mavlink.wire.fixed_frames import FixedFrame
from colibri.mavlink.wire.ned import ned_from_enu

_UNKNOWN_COVARIANCE = 255
_INVALID, _PERFECT = 1, 100  # DISTANCE_SENSOR.signal_quality
_FIELDS = (
    "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag "
    "abs_pressure diff_pressure pressure_alt temperature fields_updated"
)
_SENSOR = FixedFrame("HIL_SENSOR", _FIELDS)
_SHORTENED = [FixedFrame("HIL_SENSOR", f"{_FIELDS}:{it}") for it in "BH"]  # `fields_updated` of 1, 2 bytes
_BY_SIZE = {layout.size: layout for layout in (_SENSOR, *_SHORTENED)}
_SINGLES = Struct("<11f")
_GPS = FixedFrame("HIL_GPS", "time_usec lat lon alt eph epv vel vn ve vd cog fix_type satellites_visible")
_altitude_m = lru_cache(maxsize=1)(altitude_m)  # pressure is measured less often than frames are sent


class Updated:
    """Groups of HIL_SENSOR.fields_updated as plain numbers: `enum` flags are too slow."""

    ACCELEROMETER = 0x7
    GYROSCOPE = 0x38
    MAGNETOMETER = 0x1C0
    BAROMETER = 0x1A00  # without 0x400, differential pressure


class FixType(IntEnum):
    NO_FIX = 1
    FIX_3D = 3


@dataclass(frozen=True, slots=True)
class GpsFix:
    time_us: int  # simulated time of sending
    fix_type: int  # `FixType`, or any number of a simulator
    place: Geodetic
    velocity_enu_m_s: Vector
    horizontal_accuracy_m: float  # claimed standard deviation
    vertical_accuracy_m: float  # likewise
    satellites: int


class Distance(NamedTuple):
    """A sample of a downward rangefinder, along the body's axis."""

    distance_m: float  # infinite if out of range
    min_m: float
    max_m: float
    field_of_view_rad: float  # of its beam's cone


class SensorFrame(Record, frozen=True):
    """On-board measurements at one instant; groups that are not `updated` are old or zero."""

    time_us: int
    updated: int  # bits of `Updated`
    specific_force_flu_m_s2: Vector  # (0, 0, 9.81) at rest and level
    rate_flu_rad_s: Vector
    magnetic_field_flu_gauss: Vector
    pressure_pa: float
    temperature_c: float  # of the barometer, degrees Celsius
    gps: GpsFix | None = None
    distance: Distance | None = None

    def has(self, group: int) -> bool:
        return self.updated & group == group


class OwnMessage(NamedTuple):
    """A sensor with a message of its own beside HIL_SENSOR."""

    field: str  # of `SensorFrame`, where None is no new value
    message: str
    encoded: Callable[[Any, int], tuple[Any, ...]]  # (value, µs) -> fields
    decoded: Callable[[Message], Any]
    passed_on: bool  # to ground stations


Frame: TypeAlias = StateFrame | SensorFrame  # a frame from plant to autopilot at one instant of simulated time


def encode_sensors(codec: Codec, frame: SensorFrame) -> list[bytes]:
    (fx, fy, fz), (p, q, r) = frame.specific_force_flu_m_s2, frame.rate_flu_rad_s
    (mx, my, mz), pressure_pa = frame.magnetic_field_flu_gauss, frame.pressure_pa
    pressure = (pressure_pa / 100.0, 0.0, _altitude_m(pressure_pa))
    numbers = (frame.time_us, fx, -fy, -fz, p, -q, -r, mx, -my, -mz, *pressure, frame.temperature_c)
    updated = frame.updated
    layout = _SHORTENED[updated > 0xFF] if updated <= 0xFFFF else _SENSOR
    messages = [layout.encode(codec, (*numbers, updated))]
    if frame.gps is None and frame.distance is None:
        return messages
    for row in OWN_MESSAGES:
        value = getattr(frame, row.field)
        if value is not None:
            messages.append(codec.encode(row.message, *row.encoded(value, frame.time_us)))
    return messages


def sensors_as_received(frame: SensorFrame) -> SensorFrame | None:
    """Return a frame of HIL_SENSOR alone as rounded by its message; None for others."""
    if frame.gps is not None or frame.distance is not None:
        return None
    vectors = (*frame.specific_force_flu_m_s2, *frame.rate_flu_rad_s, *frame.magnetic_field_flu_gauss)
    fx, fy, fz, p, q, r, mx, my, mz, hpa, temperature_c = _SINGLES.unpack(
        _SINGLES.pack(*vectors, frame.pressure_pa / 100.0, frame.temperature_c)
    )
    return SensorFrame(frame.time_us, frame.updated, (fx, fy, fz), (p, q, r), (mx, my, mz), hpa * 100.0, temperature_c)


def read_sensors(datagram: bytes, source: bytes) -> SensorFrame | None:
    """Read a full-length HIL_SENSOR of `source`, possibly with a HIL_GPS; otherwise `None`."""
    layout, fix = _BY_SIZE.get(len(datagram)), None
    if layout is None:
        layout = _BY_SIZE.get(len(datagram) - _GPS.size)
        fields = layout and _GPS.read(datagram, layout.size, source)
        if not fields:
            return None
        fix = _fix(fields)
    numbers = layout and layout.read(datagram, 0, source)
    return _measured(numbers, fix) if numbers else None


def decode_sensors(sensor: Message, *others: Message) -> SensorFrame:
    own = {row.field: row.decoded(other) for other in others for row in OWN_MESSAGES if row.message == other.name}
    return _measured(_SENSOR.numbers(sensor.fields), **own)


def _measured(numbers: Sequence[Any], gps: GpsFix | None = None, distance: Distance | None = None) -> SensorFrame:
    time_us, xacc, yacc, zacc, xgyro, ygyro, zgyro, xmag, ymag, zmag, hpa, _, _, temperature_c, updated = numbers
    force, rate, field = (xacc, -yacc, -zacc), (xgyro, -ygyro, -zgyro), (xmag, -ymag, -zmag)
    return SensorFrame(time_us, updated, force, rate, field, hpa * 100.0, temperature_c, gps, distance)


def _gps_fields(fix: GpsFix, _time_us: int) -> tuple[Any, ...]:
    east, north, _ = fix.velocity_enu_m_s
    accuracies = (_in(fix.horizontal_accuracy_m, 1e2, 65534), _in(fix.vertical_accuracy_m, 1e2, 65534))
    velocity = (in_i16(each * 1e2) for each in ned_from_enu(fix.velocity_enu_m_s))
    course = round(degrees(atan2(east, north)) % 360.0 * 1e2) % 36000
    where = (*place_e7_mm(fix.place), *accuracies, _in(hypot(east, north), 1e2, 65534), *velocity, course)
    return (fix.time_us, fix.fix_type, *where, fix.satellites)


def decode_gps(message: Message) -> GpsFix:
    return _fix(_GPS.numbers(message.fields))


def _fix(numbers: Sequence[int]) -> GpsFix:
    time_us, lat, lon, alt, eph, epv, _, vn, ve, vd, _, fix_type, satellites = numbers
    place, velocity = Geodetic(lat / 1e7, lon / 1e7, alt / 1e3), ned_from_enu((vn / 100.0, ve / 100.0, vd / 100.0))
    return GpsFix(time_us, fix_type, place, velocity, _accuracy_m(eph), _accuracy_m(epv), satellites)


def _in(value: float, scale: float, maximum: int) -> int:
    return min(round(value * scale), maximum)


def in_i16(value: float) -> int:
    return max(-32767, min(32767, round(value)))


def place_e7_mm(place: Geodetic) -> tuple[int, int, int]:
    return round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7), round(place.altitude_m * 1e3)


def _accuracy_m(cm: int) -> float:
    return nan if cm == 65535 else cm / 100.0


def _distance_fields(measured: Distance, time_us: int) -> tuple[Any, ...]:
    """Return DISTANCE_SENSOR of a downward laser; quality 1 ("invalid") if out of range."""
    sees = isfinite(measured.distance_m)
    limits_cm = (_in(measured.min_m, 1e2, 65534), _in(measured.max_m, 1e2, 65534))
    distance_cm = _in(measured.distance_m, 1e2, 65535) if sees else limits_cm[1] + 1
    sensor = (mav.MAV_DISTANCE_SENSOR_LASER, 0, mav.MAV_SENSOR_ROTATION_PITCH_270, _UNKNOWN_COVARIANCE)
    beam = (measured.field_of_view_rad, measured.field_of_view_rad, (0.0,) * 4)
    quality = _PERFECT if sees else _INVALID
    return ((time_us // 1000) % 2**32, *limits_cm, distance_cm, *sensor, *beam, quality)


def _decode_distance(message: Message) -> Distance:
    d = message.fields
    distance_m = inf if d.signal_quality == _INVALID else d.current_distance / 100.0
    return Distance(distance_m, d.min_distance / 100.0, d.max_distance / 100.0, d.horizontal_fov)


OWN_MESSAGES: tuple[OwnMessage, ...] = (
    OwnMessage("gps", "HIL_GPS", _gps_fields, decode_gps, passed_on=False),
    OwnMessage("distance", "DISTANCE_SENSOR", _distance_fields, _decode_distance, passed_on=True),
)
"""In the order of the frame's datagram."""
