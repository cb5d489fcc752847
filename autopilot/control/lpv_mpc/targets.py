"""From references, or a demanded attitude, to the target of a plan."""

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, Horizon
from colibri.autopilot.control.lpv_mpc import feed_forward
from colibri.autopilot.control.lpv_mpc.approach import Approach, approach, feasible_part, stopping_s
from colibri.autopilot.control.lpv_mpc.compromise import Deviation, compromise, stay_within
from colibri.autopilot.control.lpv_mpc.cost import PlanReferences
from colibri.autopilot.control.lpv_mpc.feed_forward import Flat
from colibri.autopilot.control.lpv_mpc.mpc import Mpc
from colibri.autopilot.control.lpv_mpc.path import PathLimits, PathNow, PathSettings, carry_speeds, slide
from colibri.autopilot.control.lpv_mpc.planning import Now
from colibri.common.jit import Packed, opened, packed
from colibri.common.matrices import dot, norm
from colibri.common.records import Record
from colibri.common.types import Array

_STILL_M_S = 1e-3


class Wanted(Record, frozen=True):
    """The target of a plan."""

    target: Packed  # the `PlanReferences`
    aim: tuple[float, float, float, float, float]  # of `feed_forward.aim`
    path: PathNow | None = None  # nominal speeds along the path, if free
    deviation: Deviation | None = None  # from references beyond the largest thrust


class TargetBuilder:
    def __init__(self, guidance: Approach, path: PathSettings, mpc: Mpc) -> None:
        self._guidance, self._path, self._mpc = guidance, path, mpc
        self._compromise, self._none = packed(compromise(guidance.interval_s)), Deviation.none()
        self.law = packed(guidance)
        self._samples = n = mpc.horizon + 2
        rotors = len(mpc.from_wrench)
        track, rates, commands = np.zeros((n, 3)), np.zeros((n - 2, 3)), np.zeros((n - 1, rotors))
        attitudes, scalars, end, force = np.zeros((n, 3, 3)), np.zeros(n), np.zeros(rotors), np.zeros(3)
        self.record = packed(
            PlanReferences(track, track, track, track, attitudes, scalars, rates, commands, scalars, end, force)
        )
        self._target = target = opened(self.record, PlanReferences)
        self.force = target.force  # of the last target
        self._near = (target.position, target.velocity, target.acceleration)
        self._flat = Flat(target.forces, target.attitudes, target.rates, target.squared)
        self._of_end = Flat(np.empty((3, 3)), np.empty((3, 3, 3)), np.empty((1, 3)), np.empty((2, rotors)))

    def within_thrust(self, now: Packed, references: Horizon, deviation: Deviation | None) -> Wanted:
        """Return the target of references by the clock, or near those beyond the largest thrust."""
        p, v, a, _, _, yaw, _, _ = references
        before = self._none if deviation is None else deviation
        arrays = (before.motion.copy(), before.coefficients.copy(), before.dual.copy())
        model, near = self._mpc.model, _motion(self._samples)
        phase = stay_within(now, p, v, a, self._compromise, model, before.phase, *arrays, near)
        aim = feed_forward.follow(now, *near, yaw, self.law, model, self.record)
        return Wanted(self.record, aim, None, Deviation(phase, *arrays) if phase >= 0 else None)

    def on_path(self, record: Packed, now: Now, references: Horizon, last: Array | None, lag_s: float) -> Wanted:
        """Return the target of references at the path times of the previous plan.

        Feed-forward is that of the present speed, held; at the end, that of the final speed.
        """
        n, h, guidance, mpc, path = self._samples, self._guidance.interval_s, self._guidance, self._mpc, self._path
        limits = now.force
        upper = min(path.max_speed, 1.0 + lag_s / (mpc.horizon * h))
        speeds, slopes = np.empty(n), np.empty((n, 6))
        last = self._first_speed(now, references, upper) if last is None else last
        carry_speeds(last, mpc.starts, path.min_speed, upper, speeds)
        steady, nominal, ending = ((*_motion(samples), np.empty(samples)) for samples in (n, n, 3))
        begin, end = float(speeds[0]), float(speeds[-1])
        slide(references, 0.0, np.full(n, begin), h, steady, slopes)
        passed_s = slide(references, 0.0, speeds, h, nominal, slopes)
        slide(references, passed_s - 2.0 * h * end, np.full(3, end), h, ending, slopes[:3].copy())
        if not guidance.turns:
            feed_forward.go_on_turning(now.rigid, h, nominal[3])
            steady[3][:], ending[3][:] = nominal[3], nominal[3][-3:]
        near, flat, last_flat, target = self._near, self._flat, self._of_end, self._target
        feasible = feasible_part(*nominal[1:3], now.disturbance, limits, mpc.model)
        stop_s = stopping_s(now.disturbance, mpc.model)
        approach(now.rigid[:3], now.rigid[3:6], steady[:3], feasible, stop_s, self.law, near)
        feed_forward.ask(
            now.rigid, near[1], near[2], steady[3], now.disturbance, limits, mpc.from_wrench, mpc.model, flat
        )
        approach(now.rigid[:3], now.rigid[3:6], nominal[:3], feasible, stop_s, self.law, near)
        feed_forward.ask(now.rigid, *ending[1:], now.disturbance, limits, mpc.from_wrench, mpc.model, last_flat)
        flat.attitudes[-2], flat.rates[-1] = last_flat.attitudes[1], last_flat.rates[0]
        target.yaw_rad[:], target.end_squared[:] = nominal[3], last_flat.squared[1]
        distance_m = norm(nominal[0][0] - now.rigid[:3])
        part = 1.0 if distance_m <= guidance.max_error_m else guidance.max_error_m / distance_m
        bounds = PathLimits(path.min_speed, upper, path.reward, path.change)
        target.force[:] = feed_forward.demanded_force(now.rigid, near, now.disturbance, self.law, limits, mpc.model)
        return Wanted(self.record, feed_forward.aim(record, self.record), PathNow(speeds, slopes, part, bounds))

    def _first_speed(self, now: Now, references: Horizon, upper: float) -> Array:
        """Return the vehicle's speed along the path, (1,); 1 at a standstill."""
        along, velocity = references.velocity_enu_m_s[0].copy(), now.rigid[3:6].copy()
        squared = dot(along, along)
        speed = dot(velocity, along) / squared if squared > _STILL_M_S * _STILL_M_S else 1.0
        return np.array([min(max(speed, self._path.min_speed), upper)])

    def of_demand(self, record: Packed, now: Now, demand: AttitudeDemand) -> Wanted:
        n, flat, target, limits = self._samples, self._flat, self._target, now.force
        angles, thrusts_n = demand.angles[:n], demand.thrust_n[:n]
        if not self._guidance.turns:
            angles = angles.copy()
            feed_forward.go_on_turning(now.rigid, self._guidance.interval_s, angles[:, 2])
        feed_forward.stand(angles, thrusts_n, limits, flat)
        feed_forward.turn(flat, now.disturbance.moment, self._mpc.from_wrench, self._mpc.model)
        target.yaw_rad[:], target.end_squared[:] = angles[:, 2], flat.squared[-1]
        target.thrusts_n[:] = np.clip(thrusts_n, limits.min_n, limits.max_n)
        target.force[:] = flat.forces[0]
        return Wanted(self.record, feed_forward.aim(record, self.record))


def _motion(samples: int) -> tuple[Array, Array, Array]:
    return np.empty((samples, 3)), np.empty((samples, 3)), np.empty((samples, 3))
