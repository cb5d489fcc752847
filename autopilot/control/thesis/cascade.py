"""The thesis's second strategy: position by feedback linearisation, then attitude by LPV-MPC."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import Clock, Decision, Horizon, Preview, VehicleState
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.thesis.attitude_mpc import AttitudeMpc, AttitudeSettings
from colibri.autopilot.control.thesis.position_loop import AttitudeAndThrust, PositionController, PositionSettings
from colibri.autopilot.control.vehicle_model.mixer import Mixer
from colibri.common.config import SettingsError, Table, read_settings
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle


class CascadeSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The cascade."""

    control_interval_s: ControlInterval
    position: PositionSettings
    attitude: AttitudeSettings
    qp: QpSettings


class CascadeMemory(NamedTuple):
    """State of the cascade between two control samples."""

    rotor_speeds: Array  # last commanded, in the vehicle's unit, (N,)
    demand: AttitudeAndThrust | None  # of the present outer sample


class Cascade:
    """The control law; its predicted outputs are phi, theta, psi in rad."""

    reads_motion = False

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        settings = read_settings(table, CascadeSettings)
        self._samples = settings.position.samples
        self._horizon = settings.attitude.horizon
        self._shrinking = settings.attitude.shrinking_horizon
        if self._shrinking and self._horizon < self._samples:
            raise SettingsError("attitude.horizon: a shrinking horizon must not end before the outer sample does")
        self.control_interval_us = interval_us(settings.control_interval_s)
        self.preview = Preview(self.control_interval_us * self._samples, 2)
        self._position = PositionController(settings.position, vehicle)
        self._attitude = AttitudeMpc(
            settings.attitude, vehicle, settings.qp.build(), settings.control_interval_s, clock
        )
        self._mixer = Mixer(vehicle)

    def initial(self, rotor_speed: float) -> CascadeMemory:
        return CascadeMemory(np.full(self._mixer.rotors, rotor_speed), None)

    def step(
        self, memory: CascadeMemory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[CascadeMemory, Decision]:
        sample = (time_us // self.control_interval_us) % self._samples
        demand = memory.demand
        if demand is None or sample == 0:
            demand = self._demand(state, references)
        reference = (demand.phi, demand.theta, float(references.yaw_rad[1]))
        moment_n_m = self._mixer.wrench(memory.rotor_speeds)[1:]
        attitude = self._attitude.step(
            state.euler,
            state.rate_flu_rad_s,
            moment_n_m,
            self._mixer.momentum(memory.rotor_speeds),
            reference,
            self._horizon - sample if self._shrinking else self._horizon,
        )
        wrench = np.array([demand.thrust_n, *(moment_n_m + attitude.increment)])
        speeds = self._mixer.rotor_speeds(wrench)
        return CascadeMemory(speeds, demand), Decision(speeds, reference, attitude.diagnostics)

    def _demand(self, state: VehicleState, references: Horizon) -> AttitudeAndThrust:
        x, y, z = references.position_enu_m[1].tolist()
        vx, vy, vz = references.velocity_enu_m_s[1].tolist()
        return self._position.step(
            state.position_enu_m, state.velocity_enu_m_s, (x, y, z), (vx, vy, vz), float(references.yaw_rad[1])
        )
