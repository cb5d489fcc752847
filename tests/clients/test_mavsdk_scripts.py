"""Scripts for MAVSDK 4, each in a process of its own, against `colibri sitl`; what counts is what the vehicle did."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees, hypot, pi
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import mav
from tests.clients.mavsdk_scripts import flights, offboard, services
from tests.clients.support.client import run_script
from tests.clients.support.geometry import away_m, closest_m, during, heading_deg, speed_m_s, swept_rad
from tools.harness.observer import Observer
from tools.harness.processes import SitlProcess, vehicle

SPEED = 3.0  # times real time: MAVSDK's own time-outs run on the wall clock, and still find the vehicle prompt
PATIENT_S = 5.0
"""A companion may be silent for so long, simulated: it lives on a clock that is slower, beside other tests."""
ACCEPTANCE_M = 0.3  # so close to the height, a take-off has ended
HOME: Vector = (0.0, 0.0, 0.0)


def run(name: str, flown: SitlProcess, folder: Path) -> None:
    room = folder / name
    room.mkdir()
    run_script(name, f"udpout://127.0.0.1:{flown.port}", room)


@contextmanager
def after(name: str, folder: Path) -> Iterator[SitlProcess]:
    with vehicle(folder, speed=SPEED) as flown:
        for parameter in ("COM_OF_LOSS_T", "COM_RC_LOSS_T"):
            flown.seen.set_parameter(parameter, PATIENT_S)
        run(name, flown, folder)
        yield flown


def lands(seen: Observer, where: Vector) -> None:
    landed = seen.wait(lambda sight: not sight.flying and not sight.armed, "a landing")
    assert away_m(landed, where) < 0.3


@pytest.mark.long
def test_services(tmp_path: Path) -> None:
    """What needs no flight, one script after another, with one vehicle."""
    with vehicle(tmp_path, speed=SPEED) as flown:
        for name in ("params", "telemetry", "geofence", "ftp", "calibration"):
            run(f"services.{name}", flown, tmp_path)
        seen = flown.seen
        assert seen.parameter("MIS_TAKEOFF_ALT") == 3.5
        assert seen.plan_length(mav.MAV_MISSION_TYPE_FENCE) == len(services.CORNERS_M) + 1
        for kind in ("gyro", "accel", "mag", "level"):
            assert f"[cal] calibration done: {kind}" in seen.texts
        assert not list((flown.state / "0" / "files").glob("notes*"))
        assert seen.now.mode is Mode.HOLD
        assert not any(sight.armed or sight.flying for sight in seen.sights)


@pytest.mark.long
def test_failure(tmp_path: Path) -> None:
    """On sensors, as only they can fail."""
    with vehicle(tmp_path, "--feedback", "sensors", speed=SPEED) as flown:
        run("services.failure", flown, tmp_path)
        assert flown.seen.parameter("SYS_FAILURE_EN") == 0.0


@pytest.mark.long
def test_takeoff_and_land(tmp_path: Path) -> None:
    with after("flights.takeoff_and_land", tmp_path) as flown:
        lands(flown.seen, HOME)
        assert flown.seen.modes()[-3:] == [Mode.TAKEOFF, Mode.HOLD, Mode.LAND]
        max_height_m = max(sight.height_m for sight in flown.seen.sights)
        assert max_height_m == pytest.approx(flights.TAKEOFF_M, abs=ACCEPTANCE_M)


@pytest.mark.long
def test_offboard_position(tmp_path: Path) -> None:
    with after("offboard.position", tmp_path) as flown:
        flown.seen.wait(lambda sight: sight.mode is Mode.HOLD, "hold")
        sights = flown.seen.in_mode(Mode.OFFBOARD)
        for north, east, down, yaw in offboard.PLACES_NED_YAW:
            assert any(
                away_m(sight, (east, north, -down)) < 0.15 and abs(heading_deg(sight) - yaw) < 5.0 for sight in sights
            )


@pytest.mark.clients
def test_goto(tmp_path: Path) -> None:
    with after("flights.goto", tmp_path) as flown:
        lands(flown.seen, HOME)
        north, east, up = flights.GOTO_NORTH_EAST_UP_M
        assert closest_m(flown.seen.in_mode(Mode.HOLD), (east, north, up)) < 0.3
        assert flown.seen.modes()[-1] is Mode.RETURN


@pytest.mark.clients
def test_orbit(tmp_path: Path) -> None:
    with after("flights.orbit", tmp_path) as flown:
        begun = flown.seen.wait(lambda sight: sight.mode is Mode.ORBIT, "the orbit")
        flown.seen.wait(lambda sight: sight.time_s > begun.time_s + 30.0, "30 s of it")
        north, east, up = flights.ORBIT_NORTH_EAST_UP_M
        center = (east, north, up)
        circle = during(flown.seen.sights, begun.time_s + 12.0, begun.time_s + 30.0)
        assert {sight.mode for sight in circle} == {Mode.ORBIT}
        assert abs(swept_rad(circle, center)) > 2.0 * pi
        for sight in circle:
            assert away_m(sight, center) == pytest.approx(flights.ORBIT_RADIUS_M, abs=0.2)
            assert speed_m_s(sight) == pytest.approx(flights.ORBIT_SPEED_M_S, abs=0.2)
            assert sight.height_m == pytest.approx(up, abs=0.1)


@pytest.mark.clients
def test_mission(tmp_path: Path) -> None:
    with after("flights.mission", tmp_path) as flown:
        lands(flown.seen, HOME)
        sights = flown.seen.in_mode(Mode.MISSION)
        north_of_first, east_of_first = flights.MISSION_NORTH_EAST_M[0]
        for north, east in flights.MISSION_NORTH_EAST_M:
            assert closest_m(sights, (east, north, flights.MISSION_HEIGHT_M)) < 0.5
        first = min(sights, key=lambda sight: away_m(sight, (east_of_first, north_of_first, flights.MISSION_HEIGHT_M)))
        legs = [speed_m_s(sight) for sight in sights if sight.time_s > first.time_s]
        assert max(legs) == pytest.approx(flights.MISSION_SPEED_M_S, abs=0.1)  # MAVSDK sends a speed after its place
        modes = flown.seen.modes()
        assert modes[-4:] == [Mode.MISSION, Mode.HOLD, Mode.MISSION, Mode.RETURN]


@pytest.mark.clients
def test_offboard_velocity(tmp_path: Path) -> None:
    with after("offboard.velocity", tmp_path) as flown:
        sights = flown.seen.in_mode(Mode.OFFBOARD)
        for north, east, down, _ in offboard.VELOCITIES_NED_YAW:
            asked = (east, north, -down)
            assert any(away_m(s._replace(position_enu_m=s.velocity_enu_m_s), asked) < 0.15 for s in sights)


@pytest.mark.clients
def test_offboard_body(tmp_path: Path) -> None:
    """A circle: speed over yaw rate is its radius, and its diameter is how far apart its ends are."""
    with after("offboard.body", tmp_path) as flown:
        sights = flown.seen.in_mode(Mode.OFFBOARD)
        turning = [s for s in sights if abs(degrees(s.rate_flu_rad_s[2]) + offboard.YAW_RATE_DEG_S) < 1.0]
        turning = during(turning, turning[0].time_s + 3.0, turning[-1].time_s)
        assert turning[-1].time_s - turning[0].time_s > 360.0 / offboard.YAW_RATE_DEG_S
        assert all(speed_m_s(sight) == pytest.approx(offboard.SPEED_M_S, abs=0.2) for sight in turning)
        wide_m = 2.0 * offboard.SPEED_M_S / (offboard.YAW_RATE_DEG_S * pi / 180.0)
        for axis in (0, 1):
            along = [sight.position_enu_m[axis] for sight in turning]
            assert max(along) - min(along) == pytest.approx(wide_m, abs=0.3)


@pytest.mark.clients
def test_offboard_attitude(tmp_path: Path) -> None:
    with after("offboard.attitude", tmp_path) as flown:
        sights = flown.seen.in_mode(Mode.OFFBOARD)
        rolls = [degrees(sight.euler_rad[0]) for sight in sights]
        assert max(rolls) == pytest.approx(max(offboard.ROLLS_DEG), abs=2.0)
        assert min(rolls) == pytest.approx(min(offboard.ROLLS_DEG), abs=2.0)
        assert max(abs(degrees(sight.euler_rad[1])) for sight in sights) < 2.0
        flown.seen.wait(lambda sight: sight.mode is Mode.HOLD and hypot(*sight.velocity_enu_m_s) < 0.1, "a stop")


@pytest.mark.clients
def test_follow_me(tmp_path: Path) -> None:
    with after("flights.follow_me", tmp_path) as flown:
        sights = flown.seen.in_mode(Mode.FOLLOW)
        for north, east in flights.TARGETS_NORTH_EAST_M:
            target = (east, north, flights.FOLLOWS_UP_M)
            assert any(abs(away_m(sight, target) - flights.FOLLOWS_AT_M) < 0.3 for sight in sights)
        flown.seen.wait(lambda sight: sight.mode is Mode.HOLD, "hold")


@pytest.mark.clients
def test_manual_control(tmp_path: Path) -> None:
    with after("flights.manual_control", tmp_path) as flown:
        sights = flown.seen.in_mode(Mode.POSITION)
        assert max(sight.position_enu_m[1] for sight in sights) > 5.0
        assert max(abs(sight.position_enu_m[0]) for sight in sights) < 0.3
        assert max(heading_deg(sight) for sight in sights) > 60.0
        assert all(abs(sight.height_m - 4.0) < 0.3 for sight in sights)


@pytest.mark.clients
def test_logs(tmp_path: Path) -> None:
    with after("services.logs", tmp_path) as flown:
        (kept,) = sorted((flown.state / "0").rglob("logs/*"))
        assert (tmp_path / "services.logs" / "flight.log").read_bytes() == kept.read_bytes()
        assert kept.stat().st_size > 10_000
