"""The mission protocol over links that lose, copy and reorder."""

from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from colibri.mavlink.client.client import Client
from colibri.mavlink.client.conversation import Repeat
from colibri.mavlink.client.plans import Download, Upload
from colibri.mavlink.mission.items import FENCE, PLAN_TYPES
from colibri.mavlink.mission.service import MissionProgress
from colibri.mavlink.node.service import Peer
from colibri.mavlink.wire.dialect import mav
from tests.support.mission_ends import FIRST, SECOND, VEHICLE, Ground, bits, fielded, some_item
from tests.support.unruly_link import TARGET, Link, Vehicle

ITEMS_500 = [some_item(number) for number in range(500)]
PATIENTLY = Repeat(1_500_000, 100)


def linked(ground: Ground, clients: int, seed: int, **faults: float) -> tuple[Link, list[Client]]:
    stations = [Client(255, 190, heartbeat_every_us=None) for _ in range(clients)]
    return Link(Vehicle(ground.service), stations, seed, **faults), stations


@pytest.mark.parametrize("seed", range(10))
def test_two_stations_over_an_unruly_link(seed: int) -> None:
    """One reads what the other writes: it gets one plan or the other, never a mixture."""
    ground = Ground()
    link, (writer, reader) = linked(ground, 2, seed, loss=0.1, unruly=0.3)
    plans = [[some_item(100 * number + index) for index in range(20 + number)] for number in range(2)]
    for plan in plans:
        upload = writer.begin(Upload(TARGET, plan, FENCE, repeat=PATIENTLY))
        download = reader.begin(Download(TARGET, FENCE))
        assert link.run(lambda: None not in (upload.result, download.result))  # noqa: B023
        assert bits(ground.service.plans[FENCE].items) == bits(plan)
        assert not download.accepted or bits(download.items) in ([], bits(plans[0]), bits(plans[1]))
        link.run(lambda: False, 200_000)  # a late copy of a MISSION_ACK would end the next upload, at the station
    download = reader.begin(Download(TARGET, FENCE))
    assert link.run(lambda: download.accepted)
    assert bits(download.items) == bits(plans[-1])


ANYTHING = st.integers(0, 255)
SEQUENCES = st.one_of(st.integers(0, 4), st.integers(0, 65535))
FLOATS = st.floats(width=32)
TYPES = st.sampled_from([0, 1, 2, 3, 255])
PEERS = st.sampled_from([FIRST, SECOND])


class Conversations(RuleBasedStateMachine):
    """Whatever two stations say, in whatever order: nothing raises, and a fresh upload always succeeds."""

    def __init__(self) -> None:
        super().__init__()
        self.ground = Ground()

    def say(self, peer: Peer, name: str, *fields: Any) -> None:
        self.ground.hear(peer, name, *VEHICLE, *fields)

    @rule(peer=PEERS, number=SEQUENCES, plan_type=TYPES)
    def counts(self, peer: Peer, number: int, plan_type: int) -> None:
        self.say(peer, "MISSION_COUNT", number, plan_type)

    @rule(peer=PEERS, seq=SEQUENCES, plan_type=TYPES, current=st.integers(0, 3))
    def gives(self, peer: Peer, seq: int, plan_type: int, current: int) -> None:
        self.say(peer, "MISSION_ITEM_INT", seq, *fielded(some_item(seq), plan_type, current))

    @rule(peer=PEERS, seq=SEQUENCES, numbers=st.tuples(*[ANYTHING] * 4), params=st.tuples(*[FLOATS] * 7), kind=TYPES)
    def gives_floats(
        self, peer: Peer, seq: int, numbers: tuple[int, ...], params: tuple[float, ...], kind: int
    ) -> None:
        self.say(peer, "MISSION_ITEM", seq, *numbers, *params, kind)

    @rule(peer=PEERS, name=st.sampled_from(["MISSION_REQUEST_INT", "MISSION_REQUEST"]), seq=SEQUENCES, plan_type=TYPES)
    def asks(self, peer: Peer, name: str, seq: int, plan_type: int) -> None:
        self.say(peer, name, seq, plan_type)

    @rule(peer=PEERS, name=st.sampled_from(["MISSION_REQUEST_LIST", "MISSION_CLEAR_ALL"]), plan_type=TYPES)
    def lists_or_clears(self, peer: Peer, name: str, plan_type: int) -> None:
        self.say(peer, name, plan_type)

    @rule(peer=PEERS, result=ANYTHING, plan_type=TYPES)
    def acknowledges(self, peer: Peer, result: int, plan_type: int) -> None:
        self.say(peer, "MISSION_ACK", result, plan_type)

    @rule(peer=PEERS, seq=SEQUENCES)
    def sets_current(self, peer: Peer, seq: int) -> None:
        self.say(peer, "MISSION_SET_CURRENT", seq)
        self.ground.progress = MissionProgress(seq, mav.MISSION_STATE_ACTIVE, 1)

    @rule(after_us=st.sampled_from([0, 4_000, 250_000, 1_000_000, 5_000_000, 3600_000_000]))
    def time_passes(self, after_us: int) -> None:
        self.ground.poll(after_us)

    @invariant()
    def plans_are_as_they_were_loaded(self) -> None:
        for plan_type in PLAN_TYPES:
            loaded = [plan for kind, plan in self.ground.loaded if kind == plan_type]
            assert not loaded or self.ground.service.plans[plan_type] is loaded[-1]

    def teardown(self) -> None:
        for _ in range(25):
            self.ground.poll(250_000)
        link, stations = linked(self.ground, 2, 0)
        link.now_us = self.ground.now_us
        for station in stations:
            upload = station.begin(Upload(TARGET, ITEMS_500[:3]))
            assert link.run(lambda upload=upload: upload.result is not None)  # type: ignore[misc]
            assert upload.accepted
            assert bits(self.ground.service.plans[0].items) == bits(ITEMS_500[:3])


TestConversations = Conversations.TestCase
TestConversations.settings = settings(max_examples=60, stateful_step_count=25)
