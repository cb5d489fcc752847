"""What QGroundControl sends from its first heartbeat on, message by message, and what it needs to see of it."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import atan2, dist, hypot, nan, pi
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as mavlink2

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.common.earth.home import DEFAULT_HOME
from colibri.mavlink.mission.items import PLAN_TYPES
from tests.clients.support.ground_station import GroundStation
from tools.harness.observer import Sight
from tools.harness.processes import SitlProcess, vehicle

ACCEPTED = mavlink2.MAV_RESULT_ACCEPTED
CUSTOM = mavlink2.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
GROUND_M = DEFAULT_HOME.altitude_m
SPEED = 4.0  # times real time, of these flights


@contextmanager
def connected(folder: Path) -> Iterator[tuple[GroundStation, SitlProcess]]:
    with GroundStation() as station, vehicle(folder, links=(station.url,), speed=SPEED) as flown:
        station.wait("HEARTBEAT")
        yield station, flown


def set_mode(station: GroundStation, mode: Mode) -> None:
    """Press a mode's button: SET_MODE, which nothing acknowledges but the heartbeat."""
    station.mav.set_mode_send(1, CUSTOM, custom_mode(mode))
    station.wait("HEARTBEAT", lambda beat: beat.get_srcComponent() == 1 and beat.custom_mode == custom_mode(mode))


def take_off(station: GroundStation, flown: SitlProcess, height_m: float) -> None:
    """Slide to take off: NAV_TAKEOFF with a height above sea level, then arm, once that is acknowledged."""
    assert station.command(mavlink2.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, nan, nan, nan, GROUND_M + height_m) == ACCEPTED
    assert station.command(mavlink2.MAV_CMD_COMPONENT_ARM_DISARM, 1, 0, 0, 0, 0, 0, 0) == ACCEPTED
    station.until(flown.seen, lambda s: s.mode is Mode.HOLD and s.flying and abs(s.height_m - height_m) < 0.1, "height")


def reposition(station: GroundStation, *four_to_seven: float) -> int:
    """Send DO_REPOSITION as COMMAND_LONG, which leaves out what is not to change."""
    return station.command(mavlink2.MAV_CMD_DO_REPOSITION, -1, 1, 0, *four_to_seven)


def degrees_e7(east_m: float, north_m: float) -> tuple[int, int]:
    place = geodetic_of((east_m, north_m, 0.0), Geodetic(*DEFAULT_HOME[:3]))
    return round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)


def off_inward(sight: Sight) -> float:
    """Return how far a heading is off the direction to the centre of the circle, rad."""
    inward = atan2(5.0 - sight.position_enu_m[1], -sight.position_enu_m[0])
    return (sight.euler_rad[2] - inward + pi) % (2.0 * pi) - pi


def test_it_gets_all_that_it_asks_for_when_it_connects(tmp_path: Path) -> None:
    with connected(tmp_path) as (station, _):
        beat = station.wait("HEARTBEAT")
        assert (beat.type, beat.autopilot) == (mavlink2.MAV_TYPE_QUADROTOR, mavlink2.MAV_AUTOPILOT_PX4)

        version = station.ask(148, "AUTOPILOT_VERSION")
        assert version.capabilities & mavlink2.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        assert version.capabilities & mavlink2.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        assert version.capabilities & mavlink2.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
        assert version.capabilities & mavlink2.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
        major, minor, patch = (version.flight_sw_version >> shift & 0xFF for shift in (24, 16, 8))
        assert (major, minor, patch) >= (1, 4, 1)  # or it says that the firmware is too old
        assert version.flight_sw_version & 0xFF != mavlink2.FIRMWARE_VERSION_TYPE_OFFICIAL  # or that it is not the last

        names: dict[int, str] = {}
        station.ask(435, "AVAILABLE_MODES")
        while len(names) < len(Mode):
            modes = [message for message in station.heard if message.get_type() == "AVAILABLE_MODES"]
            assert all(message.number_modes == len(Mode) for message in modes)
            names = {message.custom_mode: message.mode_name for message in modes}
            station.pump()
        assert names == {custom_mode(mode): mode.value.title() for mode in Mode}

        metadata = station.ask(397, "COMPONENT_METADATA")
        assert bytes(metadata.uri).startswith(b"mftp://")

        station.mav.param_request_list_send(1, 1)
        value = station.wait("PARAM_VALUE")
        indices = {value.param_index}
        while len(indices) < value.param_count:
            indices.add(station.wait("PARAM_VALUE").param_index)
        assert indices == set(range(value.param_count))

        for mission_type in PLAN_TYPES:
            station.mav.mission_request_list_send(1, 1, mission_type)
            count = station.wait("MISSION_COUNT")
            assert (count.count, count.mission_type) == (0, mission_type)


@pytest.mark.long
def test_it_flies_where_it_is_told_to(tmp_path: Path) -> None:
    with connected(tmp_path) as (station, flown):
        seen = flown.seen
        take_off(station, flown, 3.0)

        # Go to a place, 12 m to the east and 5 m up.
        x, y = degrees_e7(12.0, 0.0)
        four = (-1, mavlink2.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0, nan)
        frame = mavlink2.MAV_FRAME_GLOBAL
        assert station.command_int(mavlink2.MAV_CMD_DO_REPOSITION, frame, four, x, y, GROUND_M + 5.0) == ACCEPTED
        station.until(seen, lambda s: s.position_enu_m[0] > 3.0, "the way")

        # Pause.
        assert reposition(station, nan, nan, nan, nan) == ACCEPTED
        paused = station.until(seen, lambda s: hypot(*s.velocity_enu_m_s) < 0.02, "a stop")
        assert 3.0 < paused.position_enu_m[0] < 11.0

        # Change the height alone, and then the heading alone: east.
        assert reposition(station, nan, nan, nan, GROUND_M + 2.0) == ACCEPTED
        station.until(seen, lambda s: abs(s.height_m - 2.0) < 0.1, "the height")
        assert reposition(station, 0.5 * pi, nan, nan, nan) == ACCEPTED
        station.until(seen, lambda s: abs(s.euler_rad[2]) < 0.05, "the heading")
        assert dist(seen.now.position_enu_m[:2], paused.position_enu_m[:2]) < 0.3

        # Slower, and around a centre 5 m to the north of home, looking at it.
        assert station.command(mavlink2.MAV_CMD_DO_CHANGE_SPEED, 1, 2.0, -1, 0, 0, 0, 0) == ACCEPTED
        x, y = degrees_e7(0.0, 5.0)
        around = (4.0, nan, 0, nan)
        assert station.command_int(mavlink2.MAV_CMD_DO_ORBIT, frame, around, x, y, GROUND_M + 3.0) == ACCEPTED
        station.until(seen, lambda s: s.mode is Mode.ORBIT, "the orbit")
        station.until(seen, lambda s: abs(dist(s.position_enu_m, (0.0, 5.0, 3.0)) - 4.0) < 0.2, "the circle")
        station.until(seen, lambda s: abs(hypot(*s.velocity_enu_m_s) - 2.0) < 0.2, "the speed")
        station.until(seen, lambda s: abs(off_inward(s)) < 0.05, "the heading")

        set_mode(station, Mode.LAND)
        landed = station.until(seen, lambda s: not s.armed, "the end of the flight")
        assert not landed.flying
        assert abs(landed.height_m) < 0.05


@pytest.mark.long
def test_it_flies_a_plan_and_returns(tmp_path: Path) -> None:
    with connected(tmp_path) as (station, flown):
        away = degrees_e7(0.0, 12.0)
        plan = [
            (mavlink2.MAV_CMD_NAV_TAKEOFF, *degrees_e7(0.0, 0.0), 5.0),
            (mavlink2.MAV_CMD_NAV_WAYPOINT, *away, 5.0),
            (mavlink2.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, 0, 0.0),
        ]
        station.mav.mission_count_send(1, 1, len(plan), mavlink2.MAV_MISSION_TYPE_MISSION)
        for seq, (command, x, y, z) in enumerate(plan):
            request = station.wait("MISSION_REQUEST_INT")
            assert request.seq == seq
            assert request.mission_type == mavlink2.MAV_MISSION_TYPE_MISSION
            frame = mavlink2.MAV_FRAME_GLOBAL_RELATIVE_ALT if x else mavlink2.MAV_FRAME_MISSION
            station.mav.mission_item_int_send(1, 1, seq, frame, command, 0, 1, 0, 0, 0, nan, x, y, z)
        assert station.wait("MISSION_ACK").type == mavlink2.MAV_MISSION_ACCEPTED

        set_mode(station, Mode.MISSION)
        assert station.command(mavlink2.MAV_CMD_COMPONENT_ARM_DISARM, 1, 0, 0, 0, 0, 0, 0) == ACCEPTED
        station.wait("MISSION_ITEM_REACHED", lambda reached: reached.seq == 1)
        station.until(flown.seen, lambda s: s.mode is Mode.RETURN, "the way back")
        landed = station.until(flown.seen, lambda s: not s.armed, "the end of the flight")
        assert hypot(*landed.position_enu_m[:2]) < 0.3
        assert min(dist(sight.position_enu_m, (0.0, 12.0, 5.0)) for sight in flown.seen.sights) < 1.0
        assert flown.seen.modes() == [Mode.MISSION, Mode.RETURN]
