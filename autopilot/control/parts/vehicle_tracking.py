"""Tracking of the vehicle from sample to sample: rotors, disturbances, mass and battery."""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.control.vehicle_model import rotor_lag
from colibri.autopilot.control.vehicle_model.battery import BatteryModel, charged, terminal
from colibri.autopilot.control.vehicle_model.disturbance_observer import (
    ESTIMATES,
    MEASURED,
    ObserverSettings,
    limit_near_ground,
    observe,
    observer_of,
)
from colibri.autopilot.control.vehicle_model.drag import LEARNED
from colibri.autopilot.control.vehicle_model.mass import MassSettings, follow_mass, mass_model
from colibri.autopilot.control.vehicle_model.rotor_lag import RotorModel
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.elementary import square
from colibri.common.jit import Packed, compiled, packed
from colibri.common.matrices import dot, matvec, put
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_WRENCH = 4
_NOTHING = np.empty(0)


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

    rigid: Array  # position and velocity, ENU; quaternion wxyz, FLU to ENU; body rates, FLU: (13,)
    rotation: Array  # body to earth, (3, 3)
    measured: Array  # of the observer, (9,)
    estimate: Array  # of the observer, (12,)
    mass_kg: float
    max_speed: float  # available to a rotor while all keep their power, in parts of the largest
    current_a: float


class VehicleTracker:
    def __init__(self, vehicle: Vehicle, observer: ObserverSettings, mass: MassSettings, interval_s: float) -> None:
        self.vehicle = vehicle
        self.lag = rotor_lag.rotor_lag(vehicle, interval_s)
        self.battery = BatteryModel(vehicle)
        self.allocation = vehicle.allocation() * square(vehicle.rotors.max_speed)  # squared speeds to U1..U4, N, N m
        self.momentum = vehicle.momentum_along_z() * vehicle.rotors.max_speed  # of each rotor at top speed, N m s
        observing = observer_of(observer, vehicle, interval_s)
        self.inertia = observing.inertia
        self._interval_s = interval_s
        self._observer, self._mass = packed(observing), packed(mass_model(mass, vehicle, interval_s))
        self._rotors = packed(RotorModel(self.lag, self.allocation))
        self._rotor_count = vehicle.rotors.count
        self._actuated = (4, max(self._rotor_count, _WRENCH))

    def initial(self, rotor_speed: float) -> Tracked:
        speeds = np.full(self.vehicle.rotors.count, rotor_speed / self.vehicle.rotors.max_speed)
        learned = LEARNED if self.vehicle.drag and self.vehicle.drag.learned else 0
        wrench, estimate = matvec(self.allocation, speeds * speeds), np.zeros(ESTIMATES + learned)
        return Tracked(speeds, wrench, wrench, None, estimate, 0.0, self.vehicle.body.mass_kg)

    def observe(self, tracked: Tracked, state: VehicleState) -> Observed:
        before, attitude = tracked.measured, state.attitude
        rigid = np.array((*state.position_enu_m, *state.velocity_enu_m_s, *attitude, *state.rate_flu_rad_s))
        rotation, measured, estimate = np.empty((3, 3)), np.empty(MEASURED), np.empty_like(tracked.estimate)
        mass_kg, max_speed, current_a = look(
            rigid,
            tracked.speeds,
            tracked.wrench,
            tracked.mean_wrench,
            _NOTHING if before is None else before,
            tracked.estimate,
            tracked.mass_kg,
            state.airborne,
            self.battery.open_voltage_v(tracked.charge_ah),
            self.momentum,
            self._observer,
            self._mass,
            self.battery.numbers,
            rotation,
            measured,
            estimate,
        )
        return Observed(rigid, rotation, measured, estimate, mass_kg, max_speed, current_a)

    def actuate(self, tracked: Tracked, observed: Observed, squared: Array) -> tuple[Array, Tracked]:
        """Return rotor commands, vehicle's unit, and the next tracker state."""
        _, _, measured, estimate, mass_kg, max_speed, current_a = observed
        actuated = np.empty(self._actuated)
        top = self.vehicle.rotors.max_speed
        rotor_lag.actuate(tracked.speeds, squared, max_speed, top, self._rotors, actuated)
        commands, speeds, wrench, mean_wrench = actuated
        if self._rotor_count != _WRENCH:
            commands, speeds = commands[: self._rotor_count], speeds[: self._rotor_count]
            wrench, mean_wrench = wrench[:_WRENCH], mean_wrench[:_WRENCH]
        charge_ah = charged(tracked.charge_ah, current_a, self._interval_s)
        return commands, Tracked(speeds, wrench, mean_wrench, measured, estimate, charge_ah, mass_kg)


@compiled
def look(
    rigid: Array,
    speeds: Array,
    wrench: Array,
    mean_wrench: Array,
    before: Array,  # previous `measured`, (9,), or (0,)
    estimate_before: Array,
    mass_kg: float,
    airborne: bool,
    open_v: float,  # without load
    momentum: Array,
    observer: Packed,
    mass: Packed,
    battery: Packed,
    rotation: Array,
    measured: Array,
    estimate: Array,
) -> tuple[float, float, float]:
    """Fill the arrays of `Observed`; return its mass, largest speed and current."""
    R = rotation_matrix((rigid[6], rigid[7], rigid[8], rigid[9]))
    for i in range(3):
        measured[i], measured[3 + i], measured[6 + i] = rigid[3 + i], rigid[10 + i], R[i][2]
        for j in range(3):
            rotation[i, j] = R[i][j]
    if before.shape[0] > 0:
        h = dot(momentum, speeds)
        put(observe(estimate_before, before, measured, mean_wrench, h, mass_kg, observer), estimate)
    else:
        put(estimate_before, estimate)
        put(measured, estimate[:6])
        estimate[6:ESTIMATES] = 0.0
    if airborne:
        mass_kg = follow_mass(mass_kg, estimate[6:], measured[6:], wrench[0], mass)
    else:
        limit_near_ground(estimate, estimate_before, observer)
    voltage_v, current_a = terminal(open_v, speeds, battery)
    return mass_kg, voltage_v / battery[0].full_voltage_v, current_a
