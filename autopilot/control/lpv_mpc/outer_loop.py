"""The outer loop of one vehicle: `position_loop` within the limits of the battery."""

from math import radians
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, Horizon
from colibri.autopilot.control.lpv_mpc import position_loop, prediction
from colibri.autopilot.control.lpv_mpc.condensing import Target
from colibri.autopilot.control.lpv_mpc.position_loop import Demands, Loop, Motion
from colibri.autopilot.control.parts.error_dynamics import error_transition, gains
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.vehicle_model.airframe import airframe_of
from colibri.autopilot.control.vehicle_model.rotor_lag import RotorLag
from colibri.common.config import Degrees, Negative, Positive, Table
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.kernels import tan
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle


class GuidanceSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The position loop."""

    poles: tuple[Negative, Negative]
    approach_speed_m_s: Positive
    max_tilt_deg: Degrees
    thrust_margin: Annotated[float, msgspec.Meta(ge=0.0, lt=0.5)]


class Setpoint(NamedTuple):
    """Demands of the outer loop."""

    force: Array  # of the thrust now, N, ENU, (3,)
    aligned: float  # cosine of the angle between it and the thrust axis
    target: Target


class OuterLoop:
    """From references, or an attitude demand, to the attitude setpoint."""

    def __init__(self, settings: GuidanceSettings, vehicle: Vehicle, lag: RotorLag, interval_s: float, n: int) -> None:
        k1_s2, k2_s = gains(settings.poles)
        self._samples, self._steps = n + 2, n
        errors_ahead = error_transition(settings.poles, interval_s, self._samples)
        inertia = np.array(vehicle.body.inertia_kg_m2)
        max_error_m = settings.approach_speed_m_s * k2_s / k1_s2
        airframe, follows = airframe_of(vehicle), lag.planned
        self.loop = Loop(k1_s2, k2_s, errors_ahead, max_error_m, airframe, inertia, follows, interval_s)
        self._packed = packed(self.loop)
        self._span_n = float((vehicle.allocation() * square(vehicle.rotors.max_speed))[0].sum())
        self._min_n = self._span_n * square(lag.min_speed)
        self._thrust_margin = settings.thrust_margin
        self._tilt_tangent = tan(radians(settings.max_tilt_deg))

    def track(
        self, motion: Motion, references: Horizon, planned_yaw: Array, disturbances: Array, max_speed: float
    ) -> Setpoint:
        p, v, a, *_, yaw, _, _ = references
        out = self._demands()
        aligned = position_loop.guide(
            motion, (p, v, a, yaw), planned_yaw, disturbances, self._packed, self.limits(max_speed), out
        )
        return Setpoint(out.forces[0], aligned, Target(out.angles[1:-1], out.end, out.thrusts))

    def hold(self, motion: Motion, demand: AttitudeDemand, disturbance_n_m: Array, max_speed: float) -> Setpoint:
        out = self._demands()
        aligned = position_loop.hold_attitude(
            motion, (demand.angles, demand.thrust_n), disturbance_n_m, self._packed, self.limits(max_speed), out
        )
        return Setpoint(out.forces[0], aligned, Target(out.angles[1:-1], out.end, out.thrusts))

    def _demands(self) -> Demands:
        n = self._samples
        end = np.empty(prediction.STATES + prediction.INPUTS)
        return Demands(np.empty((n, 3)), np.empty((n, 3)), np.empty(self._steps), end)

    def limits(self, max_speed: float) -> ForceLimits:
        max_n = self._span_n * square(max_speed)
        margin_n = self._thrust_margin * (max_n - self._min_n)
        min_n = self._min_n + margin_n
        return ForceLimits(self._tilt_tangent, min_n, max_n - margin_n, min_n)
