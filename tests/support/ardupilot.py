"""A stand-in for ArduPilot at the plant's JSON interface."""

import json
from struct import pack
from typing import Any

import numpy as np

from tests.support.strangers import Airframe, Known, Point, hovering

MAGIC, MAGIC_32 = 18458, 29569
TOP_RAD_S = 838.0
THRUST, TORQUE = 6.9472e-6, 2.4474e-7
TURN_M = TORQUE / THRUST
# The Hummingbird as a reversed '+': right, left, front, rear.
HUMMINGBIRD = Airframe(
    0.698,
    (0.0034, 0.0034, 0.006),
    ((0.0, 0.171, -TURN_M), (0.0, -0.171, -TURN_M), (0.171, 0.0, TURN_M), (-0.171, 0.0, TURN_M)),
)


def request(count: int, pulses: tuple[int, ...] = (1000,) * 4, rate_hz: int = 400, channels: int = 16) -> bytes:
    magic = MAGIC if channels == 16 else MAGIC_32
    return pack(f"<HHI{channels}H", magic, rate_hz, count, *pulses, *[0] * (channels - len(pulses)))


def read(reply: bytes) -> dict[str, Any]:
    """Read a reply, as strictly as ArduPilot's parser needs it."""
    assert reply[:1] == reply[-1:] == b"\n"
    assert b" " not in reply
    told: dict[str, Any] = json.loads(reply)
    return told


def pulses(told: dict[str, Any], target_ned_m: Point) -> tuple[int, ...]:
    """Return what turns the rotors so that the vehicle flies to a point, looking north."""
    known = Known(*map(np.array, (told["position"], told["velocity"], told["quaternion"], told["imu"]["gyro"])))
    speeds = np.sqrt(hovering(HUMMINGBIRD, known, target_ned_m) / THRUST) / TOP_RAD_S
    return tuple(round(1000.0 + 1000.0 * min(1.0, speed)) for speed in speeds.tolist())
