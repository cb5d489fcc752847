"""What either end of a conversation does never depends on whether a datagram could be read in one step."""

from math import inf, nan
from random import Random
from typing import Any

import pytest

from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.sensors import Frame, GpsFix, SensorFrame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.wire.fixed_frames import FixedFrame
from tests.support.lockstep_ends import ADDRESS, STRANGER, call

INTERVAL_US = 4_000
DATAGRAMS = 1_000
ODD = (0.0, -0.0, 1.0, 1.5, 1e-45, 3.4e38, nan, inf, -inf)
ATTITUDES = ((1.0, 0.0, 0.0, 0.0), (0.5, -0.5, 0.5, 0.5), (1.0, 0.02, 0.0, 0.0), (1.0, 0.2, 0.0, 0.0))
UPDATED = (0x3F, 0x1FFF, 0x1000, 0x10000, 0x80000000, 0)


def frame_of(random: Random, feedback: Feedback, time_us: int) -> Frame:
    if feedback is Feedback.STATE:
        return StateFrame(time_us, vector(random), vector(random), random.choice(ATTITUDES), vector(random))
    pressure_pa = random.uniform(9e4, 1e5)
    vectors = (vector(random), vector(random), vector(random))
    fix = gps_of(random, time_us) if random.random() < 0.3 else None
    return SensorFrame(time_us, random.choice(UPDATED), *vectors, pressure_pa, number(random), fix)


def gps_of(random: Random, time_us: int) -> GpsFix:
    place, velocity = Geodetic(random.uniform(-90.0, 90.0), random.uniform(-180.0, 180.0), 100.0), (1.0, -2.0, 0.5)
    return GpsFix(time_us, 3, place, velocity, random.random(), random.choice((0.5, 700.0)), random.choice((0, 10)))


def vector(random: Random) -> tuple[float, float, float]:
    return (number(random), number(random), number(random))


def number(random: Random) -> float:
    return random.choice(ODD) if random.random() < 0.02 else random.random()


def damaged(random: Random, datagram: bytes, before: bytes) -> bytes:
    at = random.randrange(len(datagram))
    flipped = datagram[:at] + bytes([datagram[at] ^ 1 << random.randrange(8)]) + datagram[at + 1 :]
    ways = (flipped, datagram[:at], datagram[at:], datagram + before, before + datagram, datagram + b"\0", before)
    return datagram if random.random() < 0.6 else random.choice(ways)


def conversation(feedback: Feedback, random: Random) -> list[Any]:
    plant = PlantEnd(system_id=1, frame_interval_us=INTERVAL_US, serves=[feedback])
    autopilot = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=0.0, feedback=feedback)
    call(autopilot, plant)
    said: list[Any] = []
    time_us, before, answer_before = 0, b"", b""
    for step in range(DATAGRAMS):
        now_s = step * 0.005
        plant.offer(frame_of(random, feedback, time_us), now_s)
        (outgoing,) = plant.take_outbox()
        received = autopilot.receive(damaged(random, outgoing.datagram, before), now_s)
        before = outgoing.datagram
        if received is not None:
            controls = (number(random), 0.25, 0.5, number(random))
            autopilot.answer(ActuatorCommand(received.frame.time_us, controls, armed=random.random() < 0.5))
        command = None
        for answer in autopilot.take_outbox():
            sender = ADDRESS if random.random() < 0.9 else STRANGER
            command = plant.receive(damaged(random, answer, answer_before), sender, now_s) or command
            answer_before = answer
        if command is not None or random.random() < 0.3:
            time_us = time_us + INTERVAL_US
        said += [received, command, plant.take_outbox(), list(plant.received), autopilot.silence_s(now_s)]
        plant.received.clear()
    return [*said, autopilot.repeated, dict(autopilot.dropped), dict(plant.dropped)]


@pytest.mark.parametrize("feedback", Feedback)
def test_a_conversation_is_the_same_message_by_message(feedback: Feedback, monkeypatch: pytest.MonkeyPatch) -> None:
    in_one_step = []
    untouched = FixedFrame.read

    def read(self: FixedFrame, datagram: bytes, at: int, source: bytes) -> tuple[Any, ...] | None:
        in_one_step.append(untouched(self, datagram, at, source))
        return in_one_step[-1]

    monkeypatch.setattr(FixedFrame, "read", read)
    quick = conversation(feedback, Random(1))
    assert sum(numbers is not None for numbers in in_one_step) > DATAGRAMS / 4
    monkeypatch.setattr(FixedFrame, "read", lambda *_: None)
    assert repr(conversation(feedback, Random(1))) == repr(quick)
