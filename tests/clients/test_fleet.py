"""Several vehicles of one `colibri sitl`: ids shifted, nobody obeys what is for another."""

from math import nan
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as mavlink2

from tests.clients.support.ground_station import GroundStation, Message
from tools.harness.processes import vehicle

ACCEPTED = mavlink2.MAV_RESULT_ACCEPTED
SYSTEMS = (3, 4, 5)


def is_armed(station: GroundStation, system: int) -> bool:
    beat = station.wait("HEARTBEAT", lambda beat: beat.get_srcSystem() == system)
    return bool(beat.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED)


def take_off(station: GroundStation, system: int, height_m: float) -> None:
    def there(where: Message) -> bool:
        return bool(where.get_srcSystem() == system and abs(where.z + height_m) < 0.1)

    assert station.command(mavlink2.MAV_CMD_COMPONENT_ARM_DISARM, 1, 0, 0, 0, 0, 0, 0, system=system) == ACCEPTED
    climb = (0, 0, 0, nan, nan, nan, height_m)
    assert station.command(mavlink2.MAV_CMD_NAV_TAKEOFF, *climb, system=system) == ACCEPTED
    station.wait("LOCAL_POSITION_NED", there)


@pytest.mark.long
def test_each_flies_its_own_flight(tmp_path: Path) -> None:
    with GroundStation() as station:
        with vehicle(tmp_path, "--count", "3", "--instance", "2", links=(station.url,)) as flown:
            assert not any(is_armed(station, system) for system in SYSTEMS)
            for number, system in enumerate(SYSTEMS):
                take_off(station, system, 2.0 + number)
                for other in SYSTEMS:
                    assert is_armed(station, other) == (other <= system)
            assert {message.get_srcSystem() for message in station.heard} == set(SYSTEMS)
            assert len(station.peers) == 3
            acks = [message for message in station.heard if message.get_type() == "COMMAND_ACK"]
            assert [ack.get_srcSystem() for ack in acks] == [3, 3, 4, 4, 5, 5]
            assert flown.end() == 0
        assert sorted(path.name for path in (tmp_path / "state").iterdir()) == ["2", "3", "4"]
