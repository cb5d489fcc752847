"""Path time in a whole vehicle: a track waits for a vehicle that cannot follow, and what comes after keeps the time."""

import numpy as np
import pytest
from msgspec import structs

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.types import Vector
from colibri.plant.physics.start import Start
from tools.harness.copter_flight import ACCEPTED, CopterFlight

ON_PATH = load_profile("path")
PROFILE = structs.replace(ON_PATH, simulation=structs.replace(ON_PATH.simulation, frame_interval_s=None))
TOO_FAST = "lemniscate:lap=3,height=20"
CURVE = position(track(TOO_FAST), np.linspace(0.0, 3.0, 20_000))


def flying() -> CopterFlight:
    """Return a vehicle that begins the track at its middle, at rest."""
    start = Start(x=0.0, y=0.0, z=20.0, psi=45.0, rotors=4740.0)
    return CopterFlight(profile=PROFILE, first=track(TOO_FAST), start=start)


def from_curve_m(place: Vector) -> float:
    return float(np.linalg.norm(CURVE - np.array(place), axis=1).min())


def test_a_track_that_is_too_fast_is_flown_on_its_path_and_its_reference_with_it() -> None:
    flight = flying()
    vehicle, reference = [], []
    for _ in range(250):
        flight.step()
        vehicle.append(from_curve_m(flight.position))
        assert flight.copter.pilot.generator.reference is not None
        reference.append(from_curve_m(tuple(flight.copter.pilot.generator.reference.motion[0])))
    assert max(vehicle) < 0.1
    assert max(vehicle[125:]) < 0.03
    assert max(reference) < 0.005
    assert flight.copter.pilot.lag_us == pytest.approx(flight.copter.parts.loop.lag_us, abs=8_000)
    assert 0.3e6 < flight.copter.pilot.lag_us < 1.5e6


def test_what_follows_begins_as_fast_as_the_vehicle_is() -> None:
    flight = flying()
    flight.run(1.2)
    assert flight.select(Mode.HOLD) == ACCEPTED
    flight.run(0.1)
    assert flight.copter.pilot.generator.reference is not None
    wanted_m_s = np.linalg.norm(flight.copter.pilot.generator.reference.motion[1])
    vehicle = flight.copter.pilot.sensed.vehicle
    assert vehicle is not None
    assert wanted_m_s == pytest.approx(np.linalg.norm(vehicle.velocity_enu_m_s), rel=0.15)
    assert flight.copter.parts.loop.lag_us == 0
    before_us = flight.copter.pilot.lag_us
    flight.run(0.5)
    assert flight.copter.pilot.lag_us == before_us


def test_a_restart_goes_on_at_the_same_path_time() -> None:
    flight = flying()
    flight.run(1.0)
    past, lag_us = flight.history(), flight.copter.pilot.lag_us
    flight.restart(past)
    assert flight.copter.pilot.lag_us == pytest.approx(lag_us, abs=16_000)
