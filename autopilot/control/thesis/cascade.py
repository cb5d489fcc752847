"""The thesis's second strategy: position by feedback linearisation, then attitude by LPV-MPC."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import Clock, Decision, Horizon, Preview, VehicleState
from colibri.autopilot.control.parts.riccati import gains
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.thesis.condensed_mpc import Solution, Weights, augment, condense, solve
from colibri.autopilot.control.thesis.lpv_model import ATTITUDE_OUTPUT, Discretisation, attitude_model, discretise
from colibri.autopilot.control.vehicle_model.mixer import Mixer
from colibri.common.compiled_rotations import euler_rates
from colibri.common.config import Count, Negative, Positive, SettingsError, Table, read_settings
from colibri.common.kernels import atan, cos, sin
from colibri.common.types import Array, Vector
from colibri.plant.vehicle.description import Vehicle

PerAxis = tuple[Positive, Positive, Positive]

_MIN_LIFT = 0.05  # least demanded lift in parts of gravity: the law is undefined for downward thrust


class PositionSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The outer loop."""

    samples: Count
    """Control samples in one outer sample."""
    poles: tuple[Negative, Negative]
    """Closed-loop poles of each axis, rad/s."""


class AttitudeSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The inner loop."""

    horizon: Count
    shrinking_horizon: bool
    discretisation: Discretisation
    output_weight: PerAxis
    terminal_weight: PerAxis
    increment_weight: PerAxis


class CascadeSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The cascade."""

    control_interval_s: ControlInterval
    position: PositionSettings
    attitude: AttitudeSettings
    qp: QpSettings


class AttitudeAndThrust(NamedTuple):
    phi: float  # rad
    theta: float  # rad
    thrust_n: float  # U1


class CascadeMemory(NamedTuple):
    rotor_speeds: Array  # last commanded, in the vehicle's unit, (N,)
    demand: AttitudeAndThrust | None  # of the present outer sample


class Cascade:
    """The control law; its predicted outputs are phi, theta, psi in rad."""

    reads_motion = False

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        settings = read_settings(table, CascadeSettings)
        attitude = settings.attitude
        self._samples, self._horizon = settings.position.samples, attitude.horizon
        self._shrinking = attitude.shrinking_horizon
        if self._shrinking and self._horizon < self._samples:
            raise SettingsError("attitude.horizon: a shrinking horizon must not end before the outer sample does")
        self.control_interval_us = interval_us(settings.control_interval_s)
        self.preview = Preview(self.control_interval_us * self._samples, 2)
        self._interval_s, self._discretisation = settings.control_interval_s, attitude.discretisation
        self._vehicle, self._clock, self._poles = vehicle, clock, settings.position.poles
        self._solver, self._mixer = settings.qp.build(), Mixer(vehicle)
        self._weights = Weights(
            np.array(attitude.output_weight), np.array(attitude.terminal_weight), np.array(attitude.increment_weight)
        )
        self._max_increment = 2.0 * vehicle.max_wrench()[1:]

    def initial(self, rotor_speed: float) -> CascadeMemory:
        return CascadeMemory(np.full(self._mixer.rotors, rotor_speed), None)

    def step(
        self, memory: CascadeMemory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[CascadeMemory, Decision]:
        sample = (time_us // self.control_interval_us) % self._samples
        demand, yaw_rad = memory.demand, float(references.yaw_rad[1])
        if demand is None or sample == 0:
            place, velocity = references.position_enu_m[1].tolist(), references.velocity_enu_m_s[1].tolist()
            demand = demanded(self._poles, self._vehicle, state, place, velocity, yaw_rad)
        reference = (demand.phi, demand.theta, yaw_rad)
        moment_n_m = self._mixer.wrench(memory.rotor_speeds)[1:]
        horizon = self._horizon - sample if self._shrinking else self._horizon
        attitude = self._turned(state, moment_n_m, self._mixer.momentum(memory.rotor_speeds), reference, horizon)
        wrench = np.array([demand.thrust_n, *(moment_n_m + attitude.increment)])
        speeds = self._mixer.rotor_speeds(wrench)
        return CascadeMemory(speeds, demand), Decision(speeds, reference, attitude.diagnostics)

    def _turned(
        self, state: VehicleState, moment_n_m: Array, momentum_n_m_s: float, reference: Vector, horizon: int
    ) -> Solution:
        """Return the increments of U2, U3, U4 by the MPC at the present state, bounded by full moment to full moment.

        The reference is constant over the horizon; h is at the last commands.
        """
        phi, theta, psi = state.euler
        phi_rate, theta_rate, psi_rate = euler_rates(phi, theta, state.rate_flu_rad_s)
        A, B = attitude_model(phi_rate, theta_rate, momentum_n_m_s, inertia_kg_m2=self._vehicle.body.inertia_kg_m2)
        model = augment(discretise(A, B, self._interval_s, self._discretisation), ATTITUDE_OUTPUT)
        x = np.array([phi, phi_rate, theta, theta_rate, psi, psi_rate, *moment_n_m])
        qp = condense(model, horizon, x, np.array([reference] * horizon), self._weights)
        return solve(qp, self._max_increment, self._solver, self._clock)


def demanded(
    poles: tuple[float, float], vehicle: Vehicle, state: VehicleState, place: Vector, velocity: Vector, yaw_rad: float
) -> AttitudeAndThrust:
    """Return tilt and thrust for v = k1 e + k2 e', THESIS [3.24-3.33] (erratum 5).

    The thesis's two cases of phi_ref are one.
    """
    (k1, k2), gravity_m_s2 = gains(poles), vehicle.gravity_m_s2
    errors = zip(place, state.position_enu_m, strict=True)
    speed_errors = zip(velocity, state.velocity_enu_m_s, strict=True)
    vx, vy, vz = (
        k1 * (wanted - is_now) + k2 * (speed_wanted - speed)
        for (wanted, is_now), (speed_wanted, speed) in zip(errors, speed_errors, strict=True)
    )
    lift = max(vz + gravity_m_s2, _MIN_LIFT * gravity_m_s2)
    a, b = vx / lift, vy / lift
    c, d = cos(yaw_rad), sin(yaw_rad)
    theta = atan(a * c + b * d)
    phi = atan(cos(theta) * (a * d - b * c))
    return AttitudeAndThrust(phi, theta, vehicle.body.mass_kg * lift / (cos(phi) * cos(theta)))
