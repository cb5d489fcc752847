"""A flight, stepped: its samples, and its way back to a snapshot."""

from typing import Any

import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.core.step import Received
from colibri.autopilot.core.track_stages import track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.flights.flight import Direct, FrameSample, InMemory, SteppedFlight
from colibri.mavlink.hil.faults import GPS, OFF, Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.plant.environment.weather import Wind
from colibri.plant.physics.start import default_starts
from colibri.plant.simulation.plant import Plant, PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle

PROFILE = load_profile("flight")
VEHICLE = load_vehicle("hummingbird")
FRAMES = 500
STATION = ("127.0.0.1", 14550)


def plant(feedback: Feedback, interval_us: int) -> Plant:
    gusts = WorldSpec(wind=Wind(4.0, 30.0), turbulence="light", seed=5)
    return PlantBuilder(gusts, VEHICLE, default_starts(VEHICLE)).build(feedback, interval_us)


def on_track(feedback: Feedback, **wire_options: Any) -> SteppedFlight[Any]:
    estimator = estimator_for(feedback, VEHICLE, DEFAULT_ORIGIN)
    autopilot = track_autopilot(PROFILE, VEHICLE, track("spiral"), lambda: 0.0, estimator=estimator)
    wire = InMemory(autopilot.frame_interval_us, feedback, **wire_options)
    return SteppedFlight(plant(feedback, autopilot.frame_interval_us), autopilot, wire)


def with_stations(feedback: Feedback) -> SteppedFlight[Copter]:
    settings = StationSettings(1, "px4", DEFAULT_ORIGIN, feedback=feedback)
    autopilot = copter_autopilot(PROFILE, VEHICLE, settings, lambda: 0.0, first=track("spiral"))
    autopilot.stages.stations.hub.open(0, STATION)
    return SteppedFlight(plant(feedback, autopilot.frame_interval_us), autopilot, Direct())


def flown(flight: SteppedFlight[Any]) -> list[FrameSample]:
    """Fly on, with a ground station that asks for a parameter, and later changes one."""
    codec, samples = Codec(255, 190), []
    for frame in range(FRAMES):
        inbox = []
        if frame % 100 == 0:
            inbox.append(codec.encode("HEARTBEAT", mav.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        if frame == 50:
            inbox.append(codec.encode("PARAM_SET", 1, 1, b"LPV_POLE1", -7.1, mav.MAV_PARAM_TYPE_REAL32))
        if frame == 120:
            flight.plant.inject([Fault(GPS, OFF, 1)])
        samples.append(flight.step([Received(datagram, 0, STATION) for datagram in inbox]))
    return samples


@pytest.mark.parametrize("feedback", Feedback)
@pytest.mark.parametrize("begun", [on_track, with_stations])
def test_a_restored_flight_goes_on_with_the_same_bits(feedback: Feedback, begun: Any) -> None:
    flight: SteppedFlight[Any] = begun(feedback)
    for _ in range(FRAMES):
        flight.step()
    snapshot, time_us = flight.snapshot(), flight.time_us
    first = flown(flight)
    for _ in range(2):
        flight.restore(snapshot)
        assert flight.time_us == time_us
        again = flown(flight)
        assert [sample.world.state for sample in again] == [sample.world.state for sample in first]
        assert [sample.command for sample in again] == [sample.command for sample in first]
        assert [sample.to_stations for sample in again] == [sample.to_stations for sample in first]
        assert [sample.datagram for sample in again] == [sample.datagram for sample in first]
    assert len({sample.world.state for sample in first}) == FRAMES


def test_samples_end_with_the_last_whole_frame() -> None:
    flight = on_track(Feedback.STATE)
    assert [sample.world.time_us for sample in flight.samples(0.0125)] == [4000, 8000, 12000]


@pytest.mark.parametrize(
    ("feedback", "replayed", "encoded"),
    [(Feedback.STATE, True, 4), (Feedback.SENSORS, False, 23), (Feedback.SENSORS, True, FRAMES)],
)
def test_bits_are_the_same_without_the_codec(feedback: Feedback, replayed: bool, encoded: int) -> None:
    traffic: list[bytes] = []
    recorded = on_track(feedback, traffic=lambda _us, frames: traffic.extend(frames))
    coded = [recorded.step() for _ in range(FRAMES)]
    flight = on_track(feedback, replayed=replayed)
    plain = [flight.step() for _ in range(FRAMES)]
    assert [(each.world, each.command) for each in plain] == [(each.world, each.command) for each in coded]
    assert len(traffic) > 2 * FRAMES
    sent = [(one.datagram, other.datagram) for one, other in zip(plain, coded, strict=True) if one.datagram]
    assert all(one == other for one, other in sent)
    assert len(sent) == encoded
