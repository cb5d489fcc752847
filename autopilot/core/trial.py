"""The trial of a change of parameters: every object that depends on it is built and tried before the change."""

from math import isfinite

import numpy as np

from colibri.autopilot.commander.rules.failsafe_parameters import settings
from colibri.autopilot.control.interface import AT_REST
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.core.actuation import controls_of
from colibri.autopilot.core.defence.plain_law import PlainLaw
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.ground.forecast import Forecaster
from colibri.autopilot.guidance.attitude_reference import AttitudeReference, attitude_limits
from colibri.autopilot.guidance.guidance import Instants
from colibri.autopilot.guidance.reference import at_rest, lead, still_target
from colibri.autopilot.parameters.definitions import behaviour
from colibri.mavlink.parameters.store import Parameters
from colibri.plant.vehicle.description import Vehicle


class TrialError(AutopilotError):
    """A change with which a part gives numbers that are not finite."""


class VehicleTrial:
    """Tries changes of the parameters; the control law is tried by `Tuning` itself."""

    def __init__(self, loop: ControlLoop, rotor_loss: RotorLoss, planned_at: Instants) -> None:
        self._loop, self._rotor_loss, self._planned_at = loop, rotor_loss, planned_at

    def is_ready(self, vehicle: Vehicle) -> bool:
        """Whether a vehicle can be tried; if not, design one more of its laws for landing on three rotors."""
        return self._rotor_loss.has_designed(vehicle)

    def try_vehicle(self, vehicle: Vehicle) -> None:
        """Build every part from a vehicle, and try it in hover; AutopilotError if that is impossible."""
        loop, interval_s = self._loop, self._loop.control_interval_us * 1e-6
        self._rotor_loss.try_out(vehicle)
        controls_of(PlainLaw(vehicle, interval_s).by_velocity(AT_REST, np.zeros(3)), vehicle.rotors)
        Forecaster(vehicle, interval_s, loop.plan_columns)
        if loop.takes_attitude:
            attitude = AttitudeReference(vehicle, loop.preview)
            if not isfinite(attitude.max_thrust_n / attitude.weight_n):
                raise TrialError("the vehicle's thrust and weight are not finite")

    def try_values(self, parameters: Parameters) -> None:
        """Build behaviour, limits and failsafes, and lead a reference by them; TrialError if it is not finite."""
        settings(parameters)
        flies_by = behaviour(parameters)
        preview = self._planned_at.preview
        ahead = still_target((1.0, 1.0, 1.0), 1.0, preview.samples)
        horizon, reference = lead(at_rest(AT_REST), ahead, flies_by.limits, preview.interval_us * 1e-6)
        if not all(np.isfinite(column).all() for column in (*horizon, reference.motion, reference.heading)):
            raise TrialError("no reference can be led within these limits")
        if self._loop.takes_attitude:
            AttitudeReference(self._loop.vehicle, self._loop.preview, attitude_limits(flies_by))
