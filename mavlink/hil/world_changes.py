"""In-flight changes of the plant's world, as COMMAND_LONG appended to the answer to a frame."""

from math import isfinite
from typing import Any, NamedTuple, TypeAlias

from colibri.mavlink.wire.dialect import Codec, mav

WIND: int = mav.MAV_CMD_USER_1  # param1: m/s; param2: direction of origin, degrees clockwise from north
PAYLOAD: int = mav.MAV_CMD_USER_2  # param1: kg added to the vehicle's mass
PACE: int = mav.MAV_CMD_USER_3  # param1: pace relative to real time; only a plant that keeps one obeys
MAX_PACE = 1000.0
MAX_WIND_M_S, FULL_TURN_DEG, MAX_PAYLOAD_KG = 150.0, 360.0, 100.0


class WindChange(NamedTuple):
    """A new mean wind; gusts and turbulence stay."""

    speed_m_s: float
    from_deg: float


class PayloadChange(NamedTuple):
    """A payload at the vehicle's centre of mass."""

    mass_kg: float


class PaceChange(NamedTuple):
    speed: float


WorldChange: TypeAlias = WindChange | PayloadChange | PaceChange
_NUMBERS = {WindChange: WIND, PayloadChange: PAYLOAD, PaceChange: PACE}


def encode_change(codec: Codec, change: WorldChange, target: tuple[int, int]) -> bytes:
    return codec.encode("COMMAND_LONG", *target, _NUMBERS[type(change)], 0, *change, *(0.0,) * (7 - len(change)))


def decode_change(fields: Any) -> WorldChange | None:
    p1, p2 = fields.param1, fields.param2
    wind = fields.command == WIND
    if fields.command == PACE:
        return PaceChange(p1) if 0.0 < p1 <= MAX_PACE else None
    limits = ((p1, MAX_WIND_M_S), (p2, FULL_TURN_DEG)) if wind else ((p1, MAX_PAYLOAD_KG),)
    if not all(isfinite(value) and 0.0 <= value <= most for value, most in limits):
        return None
    return WindChange(p1, p2) if wind else PayloadChange(p1)
