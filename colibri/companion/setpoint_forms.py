"""A setpoint as MAVLink message, and as row of the log."""

from math import dist
from typing import Any

from colibri.autopilot.control.interface import FALLBACK_CODES
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler
from colibri.common.types import Array
from colibri.companion.log import LogRow
from colibri.companion.settings import SetpointKind
from colibri.companion.steering import response as model
from colibri.companion.steering.law_pilot import LawDemand, first
from colibri.companion.steering.predictor import Predictor
from colibri.mavlink.client.conversation import Encoded
from colibri.mavlink.client.setpoints import attitude_target, position_target

_PULL_1_S = 1.0
"""Gain of the position error in a velocity setpoint."""


def message_of(
    kind: SetpointKind,
    now_us: int,
    target: tuple[int, int],
    asked: LawDemand,
    decided: LawDemand | None,
    thrust: float,
    y: Array,
) -> Encoded:
    """Return name and fields of a setpoint's message; `decided` is the last decision on references."""
    if kind is SetpointKind.RATES or decided is None or decided.reference is None or decided.decision is None:
        return attitude_target(target, rates=asked.rate_flu_rad_s, thrust=thrust, time_us=now_us)
    if kind is SetpointKind.ATTITUDE:
        attitude = quaternion_from_euler(*decided.decision.attitude_reference)
        return attitude_target(target, attitude, thrust=thrust, time_us=now_us)
    reference = decided.reference
    place, velocity = first(reference.position_enu_m), first(reference.velocity_enu_m_s)
    acceleration, yaw = first(reference.acceleration_enu_m_s2), float(reference.yaw_rad[0])
    if kind is SetpointKind.POSITION:
        return position_target(target, place, velocity, acceleration, yaw, time_us=now_us)
    here = first(y[None, model.POSITION])
    vx, vy, vz = (v + _PULL_1_S * (p - at) for v, p, at in zip(velocity, place, here, strict=True))
    return position_target(target, velocity=(vx, vy, vz), yaw=yaw, time_us=now_us)


def row_of(
    head: tuple[float, str, float, float],
    asked: LawDemand,
    decided: LawDemand,
    thrust: float,
    y: Array,
    predictor: Predictor,
    *,
    sent: bool,
) -> LogRow:
    """Return the row of a setpoint; `head` is time, phase, age of the state and round trip, s."""
    time_s, phase, state_age_s, round_trip_s = head
    assert decided.reference is not None, "a law has decided"
    reference, place = decided.reference, first(y[None, model.POSITION])
    wanted = first(reference.position_enu_m)
    fallback = decided.decision.diagnostics.fallback if decided.decision else None
    euler = euler_from_quaternion(tuple(y[model.ATTITUDE].tolist()))
    numbers: tuple[Any, ...] = (
        *(time_s, phase, int(decided.track_enu_m is not None), decided.track_s, state_age_s, round_trip_s),
        *(*place, *y[model.VELOCITY].tolist(), *euler, *y[model.RATE].tolist()),
        *(*wanted, *first(reference.velocity_enu_m_s), float(reference.yaw_rad[0]), dist(place, wanted)),
        *(*asked.rate_flu_rad_s, thrust, asked.thrust_n, predictor.thrust_scale),
        *(*predictor.disturbance[:3].tolist(), FALLBACK_CODES[fallback], int(sent)),
    )
    return LogRow(*numbers)
