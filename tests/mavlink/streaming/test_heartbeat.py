import pytest

from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.services.identity import GENERIC, PX4, Identity
from colibri.mavlink.streaming.heartbeat import HeartbeatService
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from tests.support.messages import message, on_the_wire

AT_REST = TelemetrySnapshot(time_us=0, base_mode=mav.MAV_MODE_FLAG_GUIDED_ENABLED, custom_mode=(4 << 16) | (3 << 24))


def beats(service: HeartbeatService, from_us: int, until_us: int) -> list[tuple[int, Send]]:
    return [(now_us, send) for now_us in range(from_us, until_us, 4_000) for send in service.poll(now_us)]


@pytest.fixture
def service() -> HeartbeatService:
    service = HeartbeatService(PX4)
    service.update(AT_REST)
    return service


def receive(service: HeartbeatService, peer: Peer, now_us: int, kind: int = mav.MAV_TYPE_GCS) -> None:
    list(service.receive(message("HEARTBEAT", kind, 8, 0, 0, 4, 3, peer=peer), peer, now_us))


def test_once_a_second_to_all(service: HeartbeatService) -> None:
    sends = beats(service, 0, 60_000_000)
    assert [now_us for now_us, _ in sends] == list(range(0, 60_000_000, 1_000_000))
    assert {send.channel for _, send in sends} == {None}


@pytest.mark.parametrize(("identity", "autopilot"), [(PX4, 12), (GENERIC, 0)])
def test_it_says_who_and_how(identity: Identity, autopilot: int) -> None:
    service = HeartbeatService(identity)
    service.update(AT_REST._replace(armed=True))
    (fields,) = (received.fields for received in on_the_wire(list(service.poll(0))))
    assert (fields.type, fields.autopilot) == (mav.MAV_TYPE_QUADROTOR, autopilot)
    assert fields.custom_mode == AT_REST.custom_mode
    assert fields.base_mode == 1 | 8 | 128
    assert fields.mavlink_version == 3


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        ({}, mav.MAV_STATE_STANDBY),
        ({"armed": True}, mav.MAV_STATE_ACTIVE),
        ({"armed": True, "failsafe": True}, mav.MAV_STATE_CRITICAL),
        ({"failsafe": True, "terminated": True}, mav.MAV_STATE_FLIGHT_TERMINATION),
    ],
)
def test_the_state_of_the_system(service: HeartbeatService, changes: dict[str, bool], state: int) -> None:
    service.update(AT_REST._replace(**changes))
    (send,) = service.poll(0)
    assert send.fields[4] == state


@pytest.mark.parametrize("news", [{"armed": True}, {"custom_mode": 1}, {"failsafe": True}])
def test_news_do_not_wait(service: HeartbeatService, news: dict[str, int]) -> None:
    list(service.poll(0))
    assert list(service.poll(4_000)) == []
    service.update(AT_REST._replace(**news))
    assert len(list(service.poll(8_000))) == 1
    assert [now_us for now_us, _ in beats(service, 12_000, 2_100_000)] == [1_008_000, 2_008_000]


def test_a_clock_that_begins_anew_is_no_silence(service: HeartbeatService) -> None:
    beats(service, 50_000_000, 52_000_000)
    assert len(beats(service, 0, 2_000_000)) == 2


def test_nothing_is_said_before_anything_is_known() -> None:
    assert list(HeartbeatService(PX4).poll(0)) == []


def test_when_a_ground_station_was_received_last(service: HeartbeatService) -> None:
    assert service.station_us is None
    service.station_us = 1_000_000
    receive(service, Peer(3, 1, 158), 2_000_000, mav.MAV_TYPE_CAMERA)
    assert service.station_us == 1_000_000
    receive(service, Peer(1, 255, 190), 3_000_000)
    assert service.station_us == 3_000_000
