import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.core.track_stages import TrackStages, track_autopilot
from colibri.autopilot.estimation.estimate import Estimate, Health
from colibri.autopilot.estimation.estimator import Estimator
from colibri.autopilot.estimation.state_source import StateSource, estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.rotations import quaternion_from_euler
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import VehicleError, load_vehicle

VEHICLE = load_vehicle("hummingbird")
FRAME_US = 4000
ALIGNED_US = 10 * FRAME_US
ZERO = (0.0, 0.0, 0.0)


WELL = Health(True, True, True, True, True, True, False, None, False, True, True, True, True, ())


def known(frame: StateFrame) -> Estimate:
    return Estimate(frame, ZERO, ZERO, ZERO, ZERO, ZERO, WELL, {}, {}, 0, ZERO, None)


class Standing(Estimator):
    made: int = 0
    caught = False

    def __init__(self, interval_us: int) -> None:
        assert interval_us == FRAME_US
        Standing.made += 1
        self._began_us: int | None = None
        self._known: Estimate | None = None

    @property
    def last(self) -> Estimate | None:
        return self._known

    def estimate(self) -> Estimate | None:
        return self._known

    def advance(self) -> None:
        pass

    def receive(self, frame: SensorFrame) -> None:
        if self._began_us is None:
            self._began_us = frame.time_us
        if frame.time_us < self._began_us + ALIGNED_US:
            return
        attitude = quaternion_from_euler(0.0, 0.0, 1.57)
        self._known = known(StateFrame(frame.time_us, (0.0, -1.0, 0.0), ZERO, attitude, ZERO))

    def record(self) -> bytes:
        return b""

    def resume(self, record: bytes, time_us: int) -> bool:
        del record, time_us
        return False


def sensors(time_us: int) -> SensorFrame:
    return SensorFrame(time_us, 0x3F, (0.0, 0.0, 9.81), ZERO, ZERO, 1e5, 15.0)


def autopilot() -> Autopilot[TrackStages]:
    return track_autopilot(load_profile("flight"), VEHICLE, track("spiral"), lambda: 0.0, estimator=Standing)


def copter() -> Autopilot[Copter]:
    settings = StationSettings(system_id=1, identity="px4", origin=DEFAULT_ORIGIN)
    return copter_autopilot(load_profile("flight"), VEHICLE, settings, lambda: 0.0, estimator=Standing)


def test_a_state_is_what_is_known() -> None:
    told = StateFrame(0, ZERO, ZERO, (1.0, 0.0, 0.0, 0.0), ZERO)
    state_source = StateSource(None, FRAME_US)
    state_source.receive(told)
    assert state_source.state() is told
    assert state_source.estimate is None


def test_before_the_first_estimate_the_rotors_stand() -> None:
    flown = autopilot()
    for time_us in range(0, ALIGNED_US, FRAME_US):
        step = flown.step(sensors(time_us))
        assert step.command.controls == (0.0, 0.0, 0.0, 0.0)
        assert not step.command.armed
        assert step.command.time_us == time_us
        assert step.decision is None


def test_the_first_estimate_begins_the_flight_from_idle() -> None:
    idle = VEHICLE.rotors.idle_speed / VEHICLE.rotors.max_speed
    flown = autopilot()
    for time_us in range(FRAME_US, ALIGNED_US + FRAME_US, FRAME_US):
        flown.step(sensors(time_us))
    first, second = flown.step(sensors(ALIGNED_US + FRAME_US)), flown.step(sensors(ALIGNED_US + 2 * FRAME_US))
    assert first.decision is None
    assert first.command.armed
    assert first.command.controls == pytest.approx((idle,) * 4)
    assert second.decision is not None
    assert max(second.command.controls) > idle


def test_a_station_vehicle_starts_with_the_first_estimate() -> None:
    flown = copter()
    for time_us in range(0, ALIGNED_US, FRAME_US):
        assert not flown.step(sensors(time_us)).command.armed
        assert flown.serve([]) == []
    flown.step(sensors(ALIGNED_US))
    flown.serve([])
    assert flown.stages.pilot.ground.standing
    assert not flown.stages.pilot.state.armed
    assert not flown.stages.stations.system.restart


def test_a_station_vehicle_is_restarted_by_a_new_flight() -> None:
    flown = copter()
    for time_us in (*range(0, ALIGNED_US + 1, FRAME_US), 0):
        flown.step(sensors(time_us))
    assert flown.stages.stations.system.restart


def test_who_is_told_the_state_estimates_nothing() -> None:
    assert estimator_for(Feedback.STATE, VEHICLE, DEFAULT_ORIGIN) is None


def test_a_vehicle_without_sensors_cannot_be_flown_on_them() -> None:
    with pytest.raises(VehicleError, match="has no sensors"):
        estimator_for(Feedback.SENSORS, load_vehicle("hummingbird-thesis"), DEFAULT_ORIGIN)
