"""Flights that lose a rotor, by seed."""

from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from math import nan
from typing import NamedTuple

import numpy as np

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.ground.stations import StationSettings
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.rotations import tilt_deg
from colibri.common.types import Array
from colibri.flights.flight import Direct, SteppedFlight
from colibri.mavlink.hil.faults import MOTOR, OFF, WRONG, Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.environment.weather import Intensity, Wind
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import state_frame
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle

HEIGHT_M = 10.0
UPRIGHT_DEG, NEAR_M, SOFT_M_S = 20.0, 5.0, 2.0
"""What must hold: tilt once settled, distance at touch-down, speed there."""
SETTLED_S = 1.0
"""So long after the loss the vehicle is to be upright for good."""
COLUMNS = ("t", "x", "y", "z", "vz", "tilt", "spin", "c1", "c2", "c3", "c4")
"""Of a path: s since the loss, m from its place (z above ground), m/s, degrees, rad/s, parts of the largest."""
_T, _X, _Y, _Z, _VZ, _TILT, _SPIN = range(7)
_BLADES_LEFT = 0.001
_BEFORE_S, _AFTER_S, _MAX_DURATION_S = 1.0, 1.5, 40.0
_WORKERS = 2
_LOW_M = 0.3
_FULL_TURN_DEG = 360.0


class RotorLossCase(NamedTuple):
    name: str
    feedback: Feedback
    runs_down: bool = False  # with its motor; else the thrust is gone at once
    wind_m_s: float = 0.0  # its direction varies by seed
    turbulence: Intensity | None = None


class RotorLossFlight(NamedTuple):
    seed: int  # of everything random; the rotor is seed mod 4
    noticed_s: float  # from the loss to its detection; nan without
    path: Array  # `COLUMNS`, one row a frame until the vehicle rests, (n, 11)
    rights: bool  # whether the right rotor was named

    @property
    def lost(self) -> Array:
        after = self.path[self.path[:, _T] > 0.0]
        # A larger change of the vertical speed between rows is the ground's.
        touched = np.flatnonzero(np.diff(after[:, _VZ]) > 9.81 * (after[1, _T] - after[0, _T]))
        low = [row for row in touched.tolist() if after[row, _Z] < _LOW_M]
        return after[: low[0] + 1] if low else after

    @property
    def peak_deg(self) -> float:
        return float(self.lost[:, _TILT].max())

    @property
    def upright_s(self) -> float:
        beyond = np.flatnonzero(self.lost[:, _TILT] > UPRIGHT_DEG)
        return float(self.lost[beyond[-1], _T]) if beyond.size else 0.0

    @property
    def settled_deg(self) -> float:
        return float(self.lost[self.lost[:, _T] > SETTLED_S, _TILT].max())

    @property
    def max_distance_m(self) -> float:
        return float(np.hypot(self.lost[:, _X], self.lost[:, _Y]).max())

    @property
    def landed_m(self) -> float:
        return float(np.hypot(self.lost[-1, _X], self.lost[-1, _Y]))

    @property
    def touched_m_s(self) -> float:
        return float(-self.lost[-1, _VZ])

    @property
    def spin_rad_s(self) -> float:
        return float(np.abs(self.lost[:, _SPIN]).max())

    @property
    def rest_deg(self) -> float:
        return float(self.path[-1, _TILT])

    @property
    def well(self) -> bool:
        upright = self.settled_deg <= UPRIGHT_DEG and self.rest_deg <= UPRIGHT_DEG
        return self.rights and upright and self.landed_m <= NEAR_M and self.touched_m_s <= SOFT_M_S


def fly(case: RotorLossCase, seed: int) -> RotorLossFlight:
    profile = load_profile("flight")
    vehicle = load_vehicle(profile.simulation.vehicle)
    wind = Wind(case.wind_m_s, _FULL_TURN_DEG * seed / 50.0)
    world = WorldSpec(wind=wind, turbulence=case.turbulence, seed=seed)
    settings = StationSettings(1, "px4", DEFAULT_ORIGIN, feedback=case.feedback)
    values = {"MIS_TAKEOFF_ALT": HEIGHT_M}
    autopilot = copter_autopilot(profile, vehicle, settings, lambda: 0.0, values=values)
    starts = {case.feedback: Start(psi=_FULL_TURN_DEG * seed / 50.0)}
    plant = PlantBuilder(world, vehicle, starts).build(case.feedback, autopilot.frame_interval_us)
    flight = SteppedFlight(plant, autopilot, Direct())
    _take_off(flight)
    rotor = seed % 4 + 1
    blades_gone = Fault(MOTOR, WRONG, rotor, (_BLADES_LEFT, 0.0, 0.0, 0.0))
    return _lose(flight, seed, Fault(MOTOR, OFF, rotor) if case.runs_down else blades_gone)


def fly_all(cases: Iterable[RotorLossCase], seeds: Iterable[int]) -> dict[RotorLossCase, list[RotorLossFlight]]:
    numbers = list(seeds)
    with ProcessPoolExecutor(_WORKERS) as pool:
        return {case: list(pool.map(fly, [case] * len(numbers), numbers)) for case in cases}


def _take_off(flight: SteppedFlight[Copter]) -> None:
    copter, plant = flight.autopilot.stages, flight.plant
    while copter.pilot.sensed.vehicle is None or copter.pilot.readiness.refusals():
        flight.step()
        assert plant.world.time_us < _MAX_DURATION_S * 1e6, "it must be ready to arm"
    copter.pilot.select(Mode.TAKEOFF, {})
    copter.pilot.arm({})
    began_us = plant.world.time_us
    while copter.pilot.state.mode is not Mode.HOLD:
        flight.step()
        assert plant.world.time_us < began_us + _MAX_DURATION_S * 1e6, "it must reach its height"


def _lose(flight: SteppedFlight[Copter], seed: int, fault: Fault) -> RotorLossFlight:
    copter, plant = flight.autopilot.stages, flight.plant
    lost_us = plant.world.time_us + round(_BEFORE_S * 1e6)
    rows: list[tuple[float, ...]] = []
    ends_us, noticed_s = lost_us + round(_MAX_DURATION_S * 1e6), nan
    while plant.world.time_us < ends_us:
        if plant.world.time_us == lost_us:
            plant.inject([fault])
        controls = flight.step().command.controls
        after_s = (plant.world.time_us - lost_us) * 1e-6
        frame = state_frame(plant.world)
        tilt_spin = (tilt_deg(frame.attitude), frame.rate_flu_rad_s[2])
        rows.append((after_s, *frame.position_enu_m, frame.velocity_enu_m_s[2], *tilt_spin, *controls))
        if copter.parts.rotor_loss.lost is not None and np.isnan(noticed_s):
            noticed_s = after_s - plant.interval_us * 1e-6
        if not copter.pilot.state.armed:
            ends_us = min(ends_us, plant.world.time_us + round(_AFTER_S * 1e6))
    path = np.array(rows)
    at_loss = int(np.argmin(np.abs(path[:, _T])))
    path[:, _X : _Y + 1] -= path[at_loss, _X : _Y + 1]
    return RotorLossFlight(seed, noticed_s, path, copter.parts.rotor_loss.lost == fault.instance - 1)
