"""Shared parts of the model-based control laws: settings, memory, warm-up, recovery."""

from typing import Protocol, Self, TypeVar

from colibri.autopilot.control.interface import AT_REST, AttitudeController, AttitudeDemand, still_horizon
from colibri.autopilot.control.parts.recovery import RecoverySettings, TurnGains, mix_with_priority, turning_moment
from colibri.autopilot.control.parts.vehicle_tracking import Observed, Tracked, VehicleTracker
from colibri.autopilot.control.settings import ControlInterval, QpSettings, interval_us
from colibri.autopilot.control.vehicle_model.disturbance_observer import ObserverSettings
from colibri.autopilot.control.vehicle_model.mass import MassSettings
from colibri.autopilot.control.vehicle_model.mixer import mixing_of
from colibri.common.config import Table
from colibri.common.matrices import dot, matvec, norm
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_UPSIDE_DOWN = (0.0, 1.0, 0.0, 0.0)


class TrackingSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law."""

    control_interval_s: ControlInterval
    observer: ObserverSettings
    mass: MassSettings
    qp: QpSettings


class TrackingMemory(Protocol):
    """Memory of a law with a tracker, a named tuple."""

    @property
    def tracked(self) -> Tracked: ...

    def _replace(self, *, tracked: Tracked) -> Self: ...


Memory = TypeVar("Memory", bound=TrackingMemory)


class TrackingLaw(AttitudeController[Memory]):
    """Base of control laws with a `tracker` of their vehicle."""

    def __init__(self, settings: TrackingSettings, fallback: RecoverySettings, vehicle: Vehicle) -> None:
        self._interval_s = settings.control_interval_s
        self.control_interval_us = interval_us(self._interval_s)
        self.tracker = VehicleTracker(vehicle, settings.observer, settings.mass, self._interval_s)
        self._fallback, self._mixing = fallback, mixing_of(self.tracker.allocation)
        self._turn = TurnGains(fallback.turn_1_s, fallback.rate_1_s, fallback.max_rate_rad_s)

    def recovered(self, force: Array, observed: Observed, least: float, most: float) -> Array:
        """Return squared rotor speeds, (m,), that turn the thrust axis to `force` the shortest way."""
        direction = matvec(observed.rotation.T, force / norm(force))
        moments = turning_moment(direction, observed.rigid[10:], self.tracker.inertia, self._turn)
        thrust_n = max(dot(force, observed.rotation[:, 2].copy()), 0.0)
        return mix_with_priority(thrust_n, moments, self._mixing, least, most)

    def warm_up(self) -> None:
        """Load compiled code by three steps from hover, the last upside down, and one for an attitude."""
        memory, references = self.initial(self.tracker.vehicle.hover_speed), still_horizon(self.preview.samples)
        for attitude in (AT_REST.attitude, AT_REST.attitude, _UPSIDE_DOWN):
            memory, _ = self.step(memory, 0, AT_REST._replace(attitude=attitude), references)
        level, _, _, _, _, no_thrust, _, _ = references
        self.step_attitude(memory, 0, AT_REST, AttitudeDemand(level, level, no_thrust))

    def charge_ah(self, memory: Memory) -> float:
        return memory.tracked.charge_ah

    def with_charge(self, memory: Memory, charge_ah: float) -> Memory:
        return memory._replace(tracked=memory.tracked._replace(charge_ah=charge_ah))

    def mass_kg(self, memory: Memory) -> float:
        return memory.tracked.mass_kg

    def with_mass(self, memory: Memory, mass_kg: float) -> Memory:
        return memory._replace(tracked=memory.tracked._replace(mass_kg=mass_kg))
