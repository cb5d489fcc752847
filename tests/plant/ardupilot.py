"""A stand-in for ArduPilot at the plant's JSON interface: it hovers, in NED and FRD as ArduPilot does."""

import json
from math import sqrt
from struct import pack
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

MAGIC, MAGIC_32 = 18458, 29569
ARM_M = 0.171
TOP_RAD_S = 838.0
THRUST, TORQUE = 6.9472e-6, 2.4474e-7
MASS_KG, GRAVITY = 0.698, 9.81
INERTIA = np.array([0.0034, 0.0034, 0.006])
# Where each motor of a reversed '+' is, forward and right, and how its drag turns the body about down.
MOTORS = ((0.0, ARM_M, -1.0), (0.0, -ARM_M, -1.0), (ARM_M, 0.0, 1.0), (-ARM_M, 0.0, 1.0))
ALLOCATION = np.array(
    [
        [1.0] * 4,
        [-right for _, right, _ in MOTORS],
        [forward for forward, _, _ in MOTORS],
        [turn * TORQUE / THRUST for *_, turn in MOTORS],
    ]
)


def request(count: int, pulses: tuple[int, ...] = (1000,) * 4, rate_hz: int = 400, channels: int = 16) -> bytes:
    """Return the datagram that asks for one step."""
    magic = MAGIC if channels == 16 else MAGIC_32
    return pack(f"<HHI{channels}H", magic, rate_hz, count, *pulses, *[0] * (channels - len(pulses)))


def read(reply: bytes) -> dict[str, Any]:
    """Read a reply, as strictly as ArduPilot's parser needs it."""
    assert reply[:1] == reply[-1:] == b"\n"
    assert b" " not in reply
    told: dict[str, Any] = json.loads(reply)
    return told


def rotation(q: list[float]) -> Array:
    """Return the matrix that turns FRD into NED."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def pulses(told: dict[str, Any], target_ned_m: tuple[float, float, float]) -> tuple[int, ...]:
    """Return what turns the rotors so that the vehicle flies to a point, looking north."""
    position, velocity = np.array(told["position"]), np.array(told["velocity"])
    R, rate = rotation(told["quaternion"]), np.array(told["imu"]["gyro"])
    wanted = np.clip(1.0 * (np.array(target_ned_m) - position), -1.0, 1.0) * 1.5 - velocity
    force = MASS_KG * (2.0 * wanted - np.array([0.0, 0.0, GRAVITY]))
    thrust_n = max(0.0, float(-force @ R[:, 2]))
    down = -force / np.linalg.norm(force)
    right = np.cross(down, [1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    aimed = np.stack([np.cross(right, down), right, down], axis=1)
    twist = 0.5 * (aimed.T @ R - R.T @ aimed)
    error = np.array([twist[2, 1], twist[0, 2], twist[1, 0]])
    moment = INERTIA * (-64.0 * error - 16.0 * rate)
    squared = np.linalg.solve(ALLOCATION, [thrust_n, *moment]) / THRUST
    return tuple(round(1000.0 + 1000.0 * min(1.0, sqrt(max(0.0, s)) / TOP_RAD_S)) for s in squared)
