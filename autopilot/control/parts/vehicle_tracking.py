"""How control laws follow their vehicle from sample to sample: rotors, disturbances, mass and battery."""

from typing import NamedTuple, Protocol, Self, TypeVar

import numpy as np

from colibri.autopilot.control.interface import AttitudeController, AttitudeDemand, Horizon, VehicleState
from colibri.autopilot.control.vehicle_model import disturbance_observer, rotor_lag
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.disturbance_observer import ObserverSettings, observer_of
from colibri.autopilot.control.vehicle_model.mass import MassSettings, follow_mass, mass_model
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.matrices import dot, matvec
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_LEVEL, _UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
_ZERO = (0.0, 0.0, 0.0)


class Tracked(NamedTuple):
    """What is remembered of the vehicle.

    Attributes:
        speeds: Rotor speeds now, as the lag has them, parts of the largest, (4,).
        wrench, mean_wrench: U1, N, and U2..U4, N m, now, and over the interval that ends now, (4,) each.
        measured: What the observer measured a sample ago, (9,); None before the first.
        estimate: Of the observer a sample ago, (12,).
        charge_ah: Charge taken from the battery.
        mass_kg: That the vehicle moves like.
    """

    speeds: Array
    wrench: Array
    mean_wrench: Array
    measured: Array | None
    estimate: Array
    charge_ah: float
    mass_kg: float


class Observed(NamedTuple):
    """What is known of the vehicle now.

    Attributes:
        rotation: Body to earth, (3, 3).
        measured, estimate: Of the observer, (9,) and (12,).
        mass_kg: That the vehicle moves like.
    """

    rotation: Array
    measured: Array
    estimate: Array
    mass_kg: float


class VehicleTracker:
    """Follows one vehicle.

    Attributes:
        vehicle: It.
        lag: Of its rotors.
        battery: Its battery.
        inertia: Ix, Iy, Iz, kg m², (3,).
        allocation: From squared rotor speeds, parts of the largest, to U1, N, and U2..U4, N m, (4, 4).
        momentum: Angular momentum of each rotor at the largest speed, along body z, N m s, (4,).
    """

    def __init__(self, vehicle: Vehicle, observer: ObserverSettings, mass: MassSettings, interval_s: float) -> None:
        """Follow `vehicle` every `interval_s`."""
        self.vehicle = vehicle
        self.lag = rotor_lag.rotor_lag(vehicle, interval_s)
        self.battery = BatteryModel(vehicle)
        self.allocation = vehicle.allocation() * square(vehicle.rotors.max_speed)
        self.momentum = vehicle.rotor_momentum() * vehicle.rotors.max_speed
        observing = observer_of(observer, vehicle, interval_s)
        self.inertia = observing.inertia
        self._interval_s = interval_s
        self._observer, self._mass = packed(observing), packed(mass_model(mass, vehicle, interval_s))

    def initial(self, rotor_speed: float) -> Tracked:
        """Return what is remembered of a vehicle whose rotors all turn at `rotor_speed` (its unit)."""
        speeds = np.full(4, rotor_speed / self.vehicle.rotors.max_speed)
        wrench, estimate = matvec(self.allocation, speeds * speeds), np.zeros(disturbance_observer.ESTIMATES)
        return Tracked(speeds, wrench, wrench, None, estimate, 0.0, self.vehicle.body.mass_kg)

    def observe(self, tracked: Tracked, state: VehicleState) -> Observed:
        """Return what is known of the vehicle in this state."""
        rotation = np.array(rotation_matrix(state.attitude))
        measured = np.array([*state.velocity_enu_m_s, *state.rate_flu_rad_s, *rotation[:, 2].tolist()])
        estimate, mass_kg = self.estimate(tracked, measured), tracked.mass_kg
        if state.airborne:
            mass_kg = follow_mass(mass_kg, estimate[6:], measured[6:], float(tracked.wrench[0]), self._mass)
        return Observed(rotation, measured, estimate, mass_kg)

    def estimate(self, tracked: Tracked, measured: Array) -> Array:
        """Return the observer's estimate, (12,), with the measurement `measured`, (9,)."""
        if tracked.measured is None:
            return disturbance_observer.first_estimate(measured)
        return disturbance_observer.observe(
            tracked.estimate,
            tracked.measured,
            measured,
            tracked.mean_wrench,
            dot(self.momentum, tracked.speeds),
            tracked.mass_kg,
            self._observer,
        )

    def actuate(self, tracked: Tracked, observed: Observed, squared: Array, max_speed: float) -> tuple[Array, Tracked]:
        """Return rotor commands, in the vehicle's unit, (4,), and what is remembered a sample later.

        `squared` are the squared speeds that the plan commands, (4,), and `max_speed` that which a rotor can reach, in
        parts of the largest.
        """
        commands, speeds, wrench, mean_wrench = rotor_lag.actuate(
            tracked.speeds, squared, self.lag, max_speed, self.allocation
        )
        charge_ah = self.battery.charge_after(tracked.charge_ah, tracked.speeds, self._interval_s)
        _, measured, estimate, mass_kg = observed
        after = Tracked(speeds, wrench, mean_wrench, measured, estimate, charge_ah, mass_kg)
        return commands * self.vehicle.rotors.max_speed, after


class TrackingMemory(Protocol):
    """What a law with a tracker carries from one control sample to the next, a named tuple."""

    @property
    def tracked(self) -> Tracked:
        """What is remembered of the vehicle."""

    def _replace(self, *, tracked: Tracked) -> Self: ...


Memory = TypeVar("Memory", bound=TrackingMemory)


class TrackingLaw(AttitudeController[Memory]):
    """What control laws that follow their vehicle by `tracker` have in common."""

    tracker: VehicleTracker

    def warm_up(self) -> None:
        """Load what is compiled: three steps from hover, the last of them upside down, and one for an attitude."""
        n = self.preview.samples
        still, level = np.zeros((n, 3)), np.zeros(n)
        references = Horizon(still, still, still, still, still, level, level, level)
        memory, hover = self.initial(self.tracker.vehicle.hover_speed), VehicleState(_ZERO, _ZERO, _LEVEL, _ZERO, _ZERO)
        for attitude in (_LEVEL, _LEVEL, _UPSIDE_DOWN):
            memory, _ = self.step(memory, 0, hover._replace(attitude=attitude), references)
        self.step_attitude(memory, 0, hover, AttitudeDemand(still, still, level))

    def charge_ah(self, memory: Memory) -> float:
        """Return the charge taken from the battery, Ah."""
        return memory.tracked.charge_ah

    def with_charge(self, memory: Memory, charge_ah: float) -> Memory:
        """Return the memory with another charge taken from the battery, Ah."""
        return memory._replace(tracked=memory.tracked._replace(charge_ah=charge_ah))

    def mass_kg(self, memory: Memory) -> float:
        """Return the mass that the vehicle moves like."""
        return memory.tracked.mass_kg

    def with_mass(self, memory: Memory, mass_kg: float) -> Memory:
        """Return the memory with another mass."""
        return memory._replace(tracked=memory.tracked._replace(mass_kg=mass_kg))
