"""The reference, which moves smoothly to a target, and follows it to the last bit once reached, until it jumps."""

from collections.abc import Sequence
from enum import IntEnum
from functools import cache
from math import pi
from typing import NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.control.interface import Horizon, VehicleState
from colibri.autopilot.guidance import integrator_chain
from colibri.autopilot.guidance.integrator_chain import Integers, Limits
from colibri.common.records import Record
from colibri.common.rotations import nearest_turn
from colibri.common.types import Array

_REACHED = 1e-5  # largest distance of the chain, whose snap changes once a sample, from a moving target
_CARRIED = 1e-2  # the same for a reference extrapolated by its derivatives


class BindingDerivative(IntEnum):
    POSITION = 0
    VELOCITY = 1
    ACCELERATION = 2


Kinds: TypeAlias = tuple[BindingDerivative, BindingDerivative, BindingDerivative]
ALL_BOUND: Kinds = (BindingDerivative.POSITION, BindingDerivative.POSITION, BindingDerivative.POSITION)


class Reference(Record, frozen=True):
    """State of the chain: position to jerk, ENU, (4, 3); yaw, unwrapped, and rate, (2,)."""

    motion: Array
    heading: Array

    @property
    def height_m(self) -> float:
        return float(self.motion[0, 2])


class Target(NamedTuple):
    """Target at each instant: position to snap, ENU, (n, 5, 3); yaw, rate, acceleration, (n, 3)."""

    motion: Array
    kinds: Kinds  # binding derivative of x, y and z
    heading: Array
    turns: bool = True  # whether yaw binds; otherwise its rate


def at_rest(state: VehicleState) -> Reference:
    return moving_with(state._replace(velocity_enu_m_s=(0.0, 0.0, 0.0)))


def moving_with(state: VehicleState) -> Reference:
    motion = np.zeros((4, 3))
    motion[0], motion[1] = state.position_enu_m, state.velocity_enu_m_s
    return Reference(motion, np.array([state.euler[2], 0.0]))


def slowed(reference: Reference, speed: float) -> Reference:
    """Scale the derivatives to time that passes at `speed`."""
    powers = np.array([[1.0], [speed], [speed * speed], [speed * speed * speed]])
    return Reference(reference.motion * powers, reference.heading * np.array([1.0, speed]))


def still_target(position_enu_m: Sequence[float], yaw_rad: float, samples: int, kinds: Kinds = ALL_BOUND) -> Target:
    motion, heading = np.zeros((samples, 5, 3)), np.zeros((samples, 3))
    motion[:, 0] = position_enu_m
    heading[:, 0] = yaw_rad
    return Target(motion, kinds, heading)


def target_of(horizon: Horizon) -> Target:
    p, v, a, j, s, yaw, rate, acceleration = horizon
    motion, heading = np.empty((len(yaw), 5, 3)), np.empty((len(yaw), 3))
    motion[:, 0], motion[:, 1], motion[:, 2], motion[:, 3], motion[:, 4] = p, v, a, j, s
    heading[:, 0], heading[:, 1], heading[:, 2] = yaw, rate, acceleration
    return Target(motion, ALL_BOUND, heading)


def lead(
    reference: Reference, target: Target, limits: Limits, interval_s: float, *, waited: bool = False
) -> tuple[Horizon, Reference]:
    """Return the references, and the chain's state at the second instant; one that `waited` was extrapolated."""
    bound = target.turns and target.kinds == ALL_BOUND
    if bound and _is_at(reference, target.motion[0, :4], target.heading[0], waited=waited):
        return _on_target(reference, target)
    motion, heading = integrator_chain.advance(
        reference.motion,
        reference.heading,
        target.motion,
        _integers(target.kinds),
        target.heading,
        target.turns,
        integrator_chain.packed_limits(limits),
        interval_s,
    )
    return Horizon(*motion, *heading), Reference(motion[:4, 1].copy(), heading[:2, 1].copy())


@cache
def _integers(kinds: Kinds) -> Integers:
    return np.array(kinds, dtype=np.int64)


def _on_target(reference: Reference, target: Target) -> tuple[Horizon, Reference]:
    heading = target.heading
    turns = round(float(reference.heading[0] - heading[0, 0]) / (2.0 * pi))
    if turns:
        heading = heading.copy()
        heading[:, 0] += 2.0 * pi * turns
    after = Reference(target.motion[1, :4].copy(), heading[1, :2].copy())
    columns = np.ascontiguousarray(target.motion.transpose(1, 0, 2)), np.ascontiguousarray(heading.T)
    return Horizon(*columns[0], *columns[1]), after


def lead_along(
    reference: Reference, plan: Horizon, limits: Limits, interval_s: float, *, waited: bool = False
) -> tuple[Horizon, Reference]:
    """Lead along a plan; once it is reached, without the slow arrays of a target."""
    if not _is_at(reference, _motion_at(plan, 0), (plan.yaw_rad[0], plan.yaw_rate_rad_s[0]), waited=waited):
        return lead(reference, target_of(plan), limits, interval_s, waited=waited)
    turns = round(float(reference.heading[0] - plan.yaw_rad[0]) / (2.0 * pi))
    if turns:
        plan = plan._replace(yaw_rad=plan.yaw_rad + 2.0 * pi * turns)
    return plan, Reference(_motion_at(plan, 1), np.array([plan.yaw_rad[1], plan.yaw_rate_rad_s[1]]))


def _motion_at(plan: Horizon, sample: int) -> Array:
    return np.array([column[sample] for column in plan[:4]])


def stays(reference: Reference, after: Reference) -> bool:
    moved = reference.motion.tobytes() != after.motion.tobytes()
    return not moved and reference.heading.tobytes() == after.heading.tobytes()


def _is_at(reference: Reference, motion: Array, heading: Sequence[float] | Array, *, waited: bool) -> bool:
    """Whether the reference has reached a target; a target may jump, a reference may not."""
    reached = _CARRIED if waited else _REACHED
    yaw, rate = reference.heading.tolist()
    if max(abs(yaw - nearest_turn(float(heading[0]), yaw)), abs(rate - float(heading[1]))) >= reached:
        return False
    if reference.motion.tobytes() == motion.tobytes():  # as at every sample but the first, and quickly compared
        return True
    return integrator_chain.is_near(reference.motion, motion, reached)
