"""Changes of a plant's world in flight, as COMMAND_LONG to the plant: the mean wind, and a payload.

They come with the answer to a frame, as faults do, so a flight is the same however often the answer is sent.
"""

from math import isfinite
from typing import Any, NamedTuple, TypeAlias

from colibri.mavlink.wire.dialect import Codec, mav

WIND: int = mav.MAV_CMD_USER_1
"""param1: m/s; param2: where it blows from, degrees clockwise from north."""
PAYLOAD: int = mav.MAV_CMD_USER_2
"""param1: kg beside the vehicle's own mass."""
MAX_WIND_M_S, FULL_TURN_DEG, MAX_PAYLOAD_KG = 150.0, 360.0, 100.0


class WindChange(NamedTuple):
    """The mean wind is another one from now on; gusts and turbulence stay."""

    speed_m_s: float
    from_deg: float


class PayloadChange(NamedTuple):
    """The vehicle carries so much at its centre of mass from now on."""

    mass_kg: float


WorldChange: TypeAlias = WindChange | PayloadChange


def encode_change(codec: Codec, change: WorldChange, target: tuple[int, int]) -> bytes:
    """Encode a change as COMMAND_LONG to system and component `target`."""
    number = WIND if isinstance(change, WindChange) else PAYLOAD
    return codec.encode("COMMAND_LONG", *target, number, 0, *change, *(0.0,) * (7 - len(change)))


def decode_change(fields: Any) -> WorldChange | None:
    """Return the change of a COMMAND_LONG; None where no world can be like that."""
    p1, p2 = fields.param1, fields.param2
    wind = fields.command == WIND
    limits = ((p1, MAX_WIND_M_S), (p2, FULL_TURN_DEG)) if wind else ((p1, MAX_PAYLOAD_KG),)
    if not all(isfinite(value) and 0.0 <= value <= most for value, most in limits):
        return None
    return WindChange(p1, p2) if wind else PayloadChange(p1)
