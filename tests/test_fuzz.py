"""The short version of the fuzzing campaign: `make fuzz` has the long one."""

import random
from pathlib import Path

import pytest

from mavlink.dialect import Codec
from mavlink.hil import ActuatorCommand, StateFrame
from mavlink.lockstep import Address, AutopilotEnd, PlantEnd
from tests.fuzz.campaign import campaign
from tests.fuzz.datagrams import AUTOPILOT, PLANT, Fuzzer

ADDRESS: Address = ("autopilot", 1)
INTERVAL_US = 100_000


@pytest.mark.parametrize("seed", range(4))
def test_decoding_never_raises_and_keeps_nothing(seed: int) -> None:
    fuzzer = Fuzzer(random.Random(seed), AUTOPILOT, PLANT)
    codec = Codec(*PLANT)
    good = Codec(*AUTOPILOT).encode("HEARTBEAT", 2, 0, 0, 0, 4, 3)
    for _ in range(2000):
        codec.decode(fuzzer.random())
        codec.decode(fuzzer.hostile())
        assert [message.frame for message in codec.decode(good)] == [good]
    assert {"malformed", "unknown", "truncated"} <= set(codec.dropped)


def frame_at(time_us: int) -> StateFrame:
    return StateFrame(time_us, (0.0, 1.0, 2.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", range(4))
def test_both_ends_hear_only_what_was_meant(seed: int) -> None:
    """Hostile datagrams from the peer's own address: each frame is still computed, each command obeyed, once."""
    chance = random.Random(seed)
    to_plant, to_autopilot = Fuzzer(chance, AUTOPILOT, PLANT), Fuzzer(chance, PLANT, AUTOPILOT)
    plant = PlantEnd(system_id=1, frame_interval_us=INTERVAL_US)
    autopilot = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=0.0)
    autopilot.poll(0.0)
    for datagram in autopilot.take_outbox():
        plant.receive(datagram, ADDRESS, 0.0)
    plant.take_outbox()
    for sample in range(100):
        time_us = sample * INTERVAL_US
        plant.offer(frame_at(time_us), 0.0)
        frames = [outgoing.datagram for outgoing in plant.take_outbox()]
        attack = [to_autopilot.hostile() for _ in range(20)] if sample else []
        computed = [autopilot.receive(datagram, 0.0) for datagram in (*attack, *frames)]
        assert [frame for frame in computed if frame] == [frame_at(time_us)]
        autopilot.answer(ActuatorCommand(time_us, (0.5, 0.5, 0.5, 0.5), armed=True))
        attack = [to_plant.hostile() for _ in range(20)] if sample else []
        obeyed = [plant.receive(datagram, ADDRESS, 0.0) for datagram in (*attack, *autopilot.take_outbox())]
        assert [command.time_us for command in obeyed if command] == [time_us]
        plant.take_outbox()
    assert plant.frame_interval_us == INTERVAL_US
    assert min(plant.dropped["invalid"], plant.dropped["foreign"], autopilot.dropped["invalid"]) > 10


def test_two_processes_under_fire(tmp_path: Path) -> None:
    outcome = campaign(tmp_path, 2500, burst=50, seed=1)
    assert outcome.failures == []
    assert set(outcome.sent.values()) == {2500}
