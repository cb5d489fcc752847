"""Conversion of numbers to message fields."""

from collections.abc import Callable, Sequence
from math import degrees, isfinite, pi
from typing import Any, TypeAlias

from colibri.common.earth.geodesy import Geodetic
from colibri.common.rotations import earth_from_body
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import definition_of
from colibri.mavlink.wire.ned import frd_from_flu

Encoder: TypeAlias = Callable[[TelemetrySnapshot], Fields | list[Fields] | None]
"""Returns a message's fields, a list for several messages, or `None` if there is nothing to send."""

UNKNOWN_U8 = 0xFF
UNKNOWN_U16 = 0xFFFF
UNKNOWN_I16 = 0x7FFF
STANDARD_GRAVITY_M_S2 = 9.80665
MILLI_G = 1000.0 / STANDARD_GRAVITY_M_S2
FULL_TURN_CDEG = 36_000
FLOAT32_MAX = 3.4028234663852886e38


def fitted(name: str, encoder: Encoder) -> Encoder:
    """Return `encoder` with numbers clamped to the fields' types; invalid messages are omitted."""
    kinds = definition_of(name).fieldtypes
    converters = [_CONVERTERS.get(kind, _as_it_is) for kind in kinds]

    def fit(fields: Fields) -> Fields:
        pairs = zip(converters, fields, strict=False)
        return tuple([tuple(map(to, value)) if type(value) is tuple else to(value) for to, value in pairs])

    def encode(snapshot: TelemetrySnapshot) -> Fields | list[Fields] | None:
        try:
            fields = encoder(snapshot)
            if fields is None:
                return None
            return [fit(one) for one in fields] if isinstance(fields, list) else fit(fields)
        except (ArithmeticError, ValueError):
            return None

    return encode


def _float32(value: float) -> float:
    if -FLOAT32_MAX <= value <= FLOAT32_MAX or not isfinite(value):
        return value
    return FLOAT32_MAX if value > 0.0 else -FLOAT32_MAX


def _integer(low: int, high: int) -> Callable[[float], int]:
    def convert(value: float) -> int:
        whole = round(value)
        return whole if low <= whole <= high else low if whole < low else high

    return convert


def _as_it_is(value: Any) -> Any:
    return value


_CONVERTERS: dict[str, Callable[[Any], Any]] = {"float": _float32, "double": _as_it_is}
for _bits in (8, 16, 32, 64):
    _CONVERTERS[f"uint{_bits}_t"] = _integer(0, 2**_bits - 1)
    _CONVERTERS[f"int{_bits}_t"] = _integer(-(2 ** (_bits - 1)), 2 ** (_bits - 1) - 1)


def degrees_e7(place: Geodetic) -> tuple[float, float]:
    return (place.latitude_deg * 1e7, place.longitude_deg * 1e7)


def in_body_frd(q: Quaternion, vector_enu: Vector) -> Vector:
    w, x, y, z = q
    return frd_from_flu(earth_from_body((w, -x, -y, -z), vector_enu))


def yaw_ned(yaw_enu_rad: float) -> float:
    """Return yaw clockwise from north, rad in (-pi, pi]."""
    turned = (pi / 2 - yaw_enu_rad) % (2.0 * pi)
    return turned - 2.0 * pi if turned > pi else turned


def compass_cdeg(angle_rad: float) -> int:
    """Return the compass direction, centidegrees, of an angle counter-clockwise from east."""
    return round(100.0 * degrees(pi / 2 - angle_rad)) % FULL_TURN_CDEG


def times(factor: float, vector: Sequence[float]) -> Vector:
    x, y, z = vector
    return (factor * x, factor * y, factor * z)


def minus(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
