"""Tracking of the vehicle from sample to sample: rotors, disturbances, mass and battery."""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model import rotor_lag
from colibri.autopilot.control.vehicle_model.battery import BatteryModel, charged
from colibri.autopilot.control.vehicle_model.disturbance_observer import (
    ESTIMATES,
    ObserverModel,
    ObserverSettings,
    observer_of,
)
from colibri.autopilot.control.vehicle_model.drag import LEARNED
from colibri.autopilot.control.vehicle_model.mass import MassModel, MassSettings, mass_model
from colibri.autopilot.control.vehicle_model.rotor_lag import RotorModel
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.matrices import matvec
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_WRENCH = 4


class Tracked(NamedTuple):
    speeds: Array  # of the rotors, parts of the largest, (m,)
    wrench: Array  # now: U1, N, and U2..U4, N m, (4,)
    mean_wrench: Array  # over the interval that ends now, (4,)
    measured: Array | None  # by the observer a sample ago, (9,)
    estimate: Array  # of the observer a sample ago, (12,)
    charge_ah: float
    mass_kg: float


class Observed(NamedTuple):
    """The estimated state of the vehicle now."""

    measured: Array  # of the observer, (9,)
    estimate: Array  # of the observer, (12,)
    mass_kg: float
    max_speed: float  # available to a rotor while all keep their power, in parts of the largest
    current_a: float
    max_n: float  # largest thrust
    psi: float  # yaw, rad, unwrapped
    airborne: bool


class TrackerModel(NamedTuple):
    momentum: Array  # of each rotor along body z at top speed, N m s, (m,)
    observer: ObserverModel
    mass: MassModel


class VehicleTracker:
    def __init__(self, vehicle: Vehicle, observer: ObserverSettings, mass: MassSettings, interval_s: float) -> None:
        self.vehicle = vehicle
        self.lag = rotor_lag.rotor_lag(vehicle, interval_s)
        self.battery = BatteryModel(vehicle)
        self.allocation = vehicle.allocation() * square(vehicle.rotors.max_speed)  # squared speeds to U1..U4, N, N m
        momentum = vehicle.momentum_along_z() * vehicle.rotors.max_speed
        observing = observer_of(observer, vehicle, interval_s)
        self.inertia = observing.inertia
        self._interval_s = interval_s
        self.model = packed(TrackerModel(momentum, observing, mass_model(mass, vehicle, interval_s)))
        self._rotors = packed(RotorModel(self.lag, self.allocation, vehicle.rotors.max_speed))
        self._rotor_count = vehicle.rotors.count
        self._actuated = (4, max(self._rotor_count, _WRENCH))

    def initial(self, rotor_speed: float) -> Tracked:
        speeds = np.full(self.vehicle.rotors.count, rotor_speed / self.vehicle.rotors.max_speed)
        learned = LEARNED if self.vehicle.drag and self.vehicle.drag.learned else 0
        wrench, estimate = matvec(self.allocation, speeds * speeds), np.zeros(ESTIMATES + learned)
        return Tracked(speeds, wrench, wrench, None, estimate, 0.0, self.vehicle.body.mass_kg)

    def actuate(self, tracked: Tracked, observed: Observed, squared: Array) -> tuple[Array, Tracked]:
        """Return rotor commands, vehicle's unit, and the next tracker state."""
        actuated = np.empty(self._actuated)
        rotor_lag.actuate(tracked.speeds, squared, observed.max_speed, self._rotors, actuated)
        commands, speeds, wrench, mean_wrench = actuated
        if self._rotor_count != _WRENCH:
            commands, speeds = commands[: self._rotor_count], speeds[: self._rotor_count]
            wrench, mean_wrench = wrench[:_WRENCH], mean_wrench[:_WRENCH]
        charge_ah = charged(tracked.charge_ah, observed.current_a, self._interval_s)
        seen = observed.measured, observed.estimate
        return commands, Tracked(speeds, wrench, mean_wrench, *seen, charge_ah, observed.mass_kg)
