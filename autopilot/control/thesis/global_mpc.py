"""The thesis's first strategy, kept because it fails: one LPV-MPC for position and yaw, THESIS [3.1, 3.4].

It never tilts: with phi = theta = 0 the rows of B for x' and y' are zero in the frozen model. Height fails too: B[z',
U1] = -g/U1 + 1/m is zero at hover, and has the wrong sign below it. Only yaw is tracked.
"""

from collections.abc import Mapping
from math import copysign
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import Clock, Decision, Horizon, Preview, VehicleState
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.thesis.condensed_mpc import Weights, augment, condense, solve
from colibri.autopilot.control.thesis.lpv_model import (
    GLOBAL_OUTPUT,
    Discretisation,
    attitude_model,
    discretise,
    global_model,
)
from colibri.autopilot.control.vehicle_model.mixer import Mixer
from colibri.common.compiled_rotations import euler_rates
from colibri.common.config import Count, Positive, Table, read_settings
from colibri.common.types import Array, Vector
from colibri.plant.vehicle.description import Vehicle

PerOutput = tuple[Positive, Positive, Positive, Positive]

_MIN_THRUST = 0.01  # least magnitude of the last thrust, a divisor in the model, in parts of the weight

_UNBOUNDED = 1e6  # the thesis bounds no increment; this multiple of the largest wrench never binds


class GlobalSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The global MPC."""

    control_interval_s: ControlInterval
    horizon: Count
    discretisation: Discretisation
    output_weight: PerOutput
    terminal_weight: PerOutput
    increment_weight: PerOutput
    qp: QpSettings


class GlobalMemory(NamedTuple):
    wrench: Array  # last U1 (N), U2..U4 (N m) decided, (4,); unbounded as in the thesis, so U1 may be negative
    rotor_speeds: Array  # last commanded, in the vehicle's unit, (N,)


class GlobalMpc:
    """The control law; its predicted outputs are x, y, z in m and psi in rad."""

    reads_motion = False

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        self._settings = read_settings(table, GlobalSettings)
        self.control_interval_us = interval_us(self._settings.control_interval_s)
        self.preview = Preview(self.control_interval_us, self._settings.horizon + 1)
        self._vehicle = vehicle
        self._clock = clock
        self._solver = self._settings.qp.build()
        self._mixer = Mixer(vehicle)
        self._max_increment = _UNBOUNDED * vehicle.max_wrench()
        self._weights = Weights(
            np.array(self._settings.output_weight),
            np.array(self._settings.terminal_weight),
            np.array(self._settings.increment_weight),
        )

    def initial(self, rotor_speed: float) -> GlobalMemory:
        speeds = np.full(self._mixer.rotors, rotor_speed)
        return GlobalMemory(self._mixer.wrench(speeds), speeds)

    def step(
        self, memory: GlobalMemory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[GlobalMemory, Decision]:
        del time_us
        phi, theta, psi = state.euler
        rates = euler_rates(phi, theta, state.rate_flu_rad_s)
        motion = zip((*state.position_enu_m, phi, theta, psi), (*state.velocity_enu_m_s, *rates), strict=True)
        x = np.array([*(value for pair in motion for value in pair), *memory.wrench])
        A, B = self._model(state, rates, float(memory.wrench[0]), self._mixer.momentum(memory.rotor_speeds))
        model = augment(
            discretise(A, B, self._settings.control_interval_s, self._settings.discretisation), GLOBAL_OUTPUT
        )
        wanted = np.column_stack([references.position_enu_m[1:], references.yaw_rad[1:]])
        qp = condense(model, self._settings.horizon, x, wanted, self._weights)
        increment, diagnostics = solve(qp, self._max_increment, self._solver, self._clock)
        wrench = memory.wrench + increment
        speeds = self._mixer.rotor_speeds(wrench)
        return GlobalMemory(wrench, speeds), Decision(speeds, (0.0, 0.0, float(references.yaw_rad[1])), diagnostics)

    def _model(
        self, state: VehicleState, rates: Vector, thrust_n: float, rotor_momentum_n_m_s: float
    ) -> tuple[Array, Array]:
        body, gravity_m_s2 = self._vehicle.body, self._vehicle.gravity_m_s2
        min_n = _MIN_THRUST * body.mass_kg * gravity_m_s2
        thrust_n = copysign(max(abs(thrust_n), min_n), thrust_n)
        attitude = attitude_model(rates[0], rates[1], rotor_momentum_n_m_s, inertia_kg_m2=body.inertia_kg_m2)
        return global_model(attitude, state.euler, thrust_n, mass_kg=body.mass_kg, gravity_m_s2=gravity_m_s2)
