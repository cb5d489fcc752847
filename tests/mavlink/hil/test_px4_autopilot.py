from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.hil.px4_autopilot import ANSWER_AGAIN_AFTER_S, CALL_EVERY_S, FlierEnd
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame, Updated, encode_sensors
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.wire.dialect import PLANT_COMPONENT, Codec, Message, mav

FIRST_US = 1_700_000_123_000
ALL = Updated.ACCELEROMETER | Updated.GYROSCOPE | Updated.MAGNETOMETER | Updated.BAROMETER
FIX = GpsFix(FIRST_US + 4000, 3, DEFAULT_ORIGIN, (1.0, 0.0, 0.0), 0.5, 0.8, 10)


def frame(number: int, updated: int = int(ALL), gps: GpsFix | None = None) -> SensorFrame:
    at_us = FIRST_US + 4000 * number
    return SensorFrame(at_us, updated, (0.0, 0.0, 9.81), (0.1, 0.0, 0.0), (0.2, 0.0, -0.4), 95000.0, 15.0, gps)


class Simulator:
    def __init__(self) -> None:
        self.codec = Codec(1, PLANT_COMPONENT)
        self.end = FlierEnd(system_id=1, now_s=0.0, to_motors=lambda c: (c[2] ** 2, c[0] ** 2, c[3] ** 2, c[1] ** 2))

    def send(self, *frames: SensorFrame, now_s: float = 0.0) -> list[SensorFrame]:
        got = []
        for sent in frames:
            for datagram in encode_sensors(self.codec, sent):
                received = self.end.receive(datagram, now_s)
                if received is not None:
                    assert isinstance(received.frame, SensorFrame)
                    got.append(received.frame)
        return got

    def received(self) -> list[Message]:
        return [message for datagram in self.end.take_outbox() for message in self.codec.decode(datagram)]


def command(time_us: int, armed: bool = True) -> ActuatorCommand:
    return ActuatorCommand(time_us, (0.1, 0.2, 0.3, 0.4), armed)


def test_it_calls_until_it_is_served_and_goes_on_with_heartbeats() -> None:
    simulator = Simulator()
    due_s = simulator.end.poll(0.0)
    assert due_s == CALL_EVERY_S
    assert [message.name for message in simulator.received()] == ["HEARTBEAT"]
    simulator.end.poll(0.9 * CALL_EVERY_S)
    assert simulator.received() == []
    simulator.send(frame(0), now_s=0.5)
    simulator.end.answer(command(0))
    simulator.received()
    simulator.end.poll(CALL_EVERY_S)
    (heartbeat,) = simulator.received()
    assert heartbeat.fields.base_mode == mav.MAV_MODE_FLAG_SAFETY_ARMED


def test_an_answer_has_the_simulators_time_order_and_unit() -> None:
    simulator = Simulator()
    got = simulator.send(frame(0), frame(1))
    assert [sensors.time_us for sensors in got] == [0, 4000]
    simulator.end.answer(command(4000))
    (answer,) = simulator.received()
    assert (answer.name, answer.fields.time_usec) == ("HIL_ACTUATOR_CONTROLS", FIRST_US + 4000)
    assert answer.fields.controls[:4] == pytest.approx([0.09, 0.01, 0.16, 0.04])
    assert (answer.fields.mode & mav.MAV_MODE_FLAG_SAFETY_ARMED, answer.fields.flags) == (128, 1)


def test_a_fix_behind_its_frame_belongs_to_the_next() -> None:
    simulator = Simulator()
    got = simulator.send(frame(0), frame(1, gps=FIX), frame(2), frame(3))
    assert [None if sensors.gps is None else sensors.gps.time_us for sensors in got] == [None, None, 8000, None]
    assert got[2].gps == replace(FIX, time_us=8000)


@pytest.mark.parametrize("empty", [0, 1 << 31])
def test_a_simulator_that_says_nothing_of_what_is_new_means_all(empty: int) -> None:
    simulator = Simulator()
    got = simulator.send(frame(0, updated=empty), frame(1, updated=int(Updated.GYROSCOPE)))
    assert [sensors.updated for sensors in got] == [ALL, Updated.GYROSCOPE]


def test_a_frame_that_comes_again_gets_the_remembered_answer() -> None:
    simulator = Simulator()
    simulator.send(frame(0))
    assert simulator.send(frame(0)) == []
    assert simulator.received() == []
    simulator.end.answer(command(0))
    first = simulator.received()
    assert simulator.send(frame(0)) == []
    (again,) = simulator.received()
    assert again.fields.controls == first[0].fields.controls
    assert simulator.end.repeated == 2


def test_an_answer_that_was_lost_is_sent_again() -> None:
    simulator = Simulator()
    simulator.send(frame(0))
    simulator.end.answer(command(0))
    simulator.end.poll(0.0)
    simulator.received()
    simulator.end.poll(1.01 * ANSWER_AGAIN_AFTER_S)
    assert [message.name for message in simulator.received()] == ["HEARTBEAT", "HIL_ACTUATOR_CONTROLS"]


def test_a_simulator_that_begins_anew_is_another_flight() -> None:
    simulator = Simulator()
    simulator.send(frame(5), frame(6, gps=FIX))
    got = simulator.send(frame(2), frame(3))
    assert [(sensors.time_us, sensors.gps) for sensors in got] == [(0, None), (4000, None)]


@given(st.lists(st.binary(max_size=80)))
def test_nothing_that_comes_breaks_it(datagrams: list[bytes]) -> None:
    simulator = Simulator()
    for datagram in datagrams:
        simulator.end.receive(datagram, 0.0)
    assert simulator.end.silence_s(0.0) > 0.0
