"""Tracking of the vehicle from sample to sample: rotors, disturbances, mass and battery."""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model import rotor_lag
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
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
from colibri.common.records import Record
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_WRENCH = 4


class Tracked(Record, frozen=True):
    rotors: Array  # rows: commands, vehicle's unit; speeds, parts of the largest; wrench; its last mean; (4, m >= 4)
    measured: Array  # by the observer a sample ago, (9,); empty at first
    estimate: Array  # of the observer a sample ago, (12,)
    charge_ah: float
    mass_kg: float


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
        self.model = packed(TrackerModel(momentum, observing, mass_model(mass, vehicle, interval_s)))
        self._rotors = packed(RotorModel(self.lag, self.allocation, vehicle.rotors.max_speed))
        self._actuated = (4, max(vehicle.rotors.count, _WRENCH))

    def initial(self, rotor_speed: float) -> Tracked:
        rotors, count = np.zeros(self._actuated), self.vehicle.rotors.count
        rotors[1, :count] = rotor_speed / self.vehicle.rotors.max_speed
        rotors[2:, :_WRENCH] = matvec(self.allocation, rotors[1, :count] * rotors[1, :count])
        learned = LEARNED if self.vehicle.drag and self.vehicle.drag.learned else 0
        return Tracked(rotors, np.empty(0), np.zeros(ESTIMATES + learned), 0.0, self.vehicle.body.mass_kg)

    def actuate(self, tracked: Tracked, squared: Array, max_speed: float) -> tuple[Array, Tracked]:
        """Return rotor commands, vehicle's unit, and the next tracker state; `max_speed` in parts of the largest."""
        rotors = np.empty(self._actuated)
        rotor_lag.actuate(tracked.rotors, squared, max_speed, self._rotors, rotors)
        after = Tracked(rotors, tracked.measured, tracked.estimate, tracked.charge_ah, tracked.mass_kg)
        return rotors[0, : squared.size], after
