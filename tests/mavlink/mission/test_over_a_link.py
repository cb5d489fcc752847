"""The mission protocol over links that lose, copy and reorder."""

from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from colibri.mavlink.mission.items import ACCEPTED, PLAN_TYPES
from colibri.mavlink.mission.service import Progress
from colibri.mavlink.node.service import Peer
from colibri.mavlink.wire.dialect import mav
from tests.support.mission_ends import FIRST, SECOND, VEHICLE, Ground, Link, Station, bits, fielded, some_item

MINUTE_US = 60_000_000
ITEMS_500 = [some_item(number) for number in range(500)]


@pytest.mark.parametrize("seed", range(3))
def test_500_items_survive_20_percent_loss(seed: int) -> None:
    ground, station = Ground(), Station(FIRST)
    link = Link(ground, [station], seed, loss=0.2, unruly=0.0)
    station.upload(0, ITEMS_500, 0)
    assert link.run(10 * MINUTE_US, lambda: station.result is not None)
    assert station.result == ACCEPTED
    assert bits(ground.service.plans[0].items) == bits(ITEMS_500)
    station.download(0, ground.now_us)
    assert link.run(10 * MINUTE_US, lambda: station.result is not None)
    assert bits(station.received) == bits(ITEMS_500)
    assert station.opaque_id == ground.service.plans[0].id


@pytest.mark.parametrize("seed", range(10))
def test_two_stations_over_an_unruly_link(seed: int) -> None:
    """One reads what the other writes: it gets one plan or the other, never a mixture."""
    ground, writer, reader = Ground(), Station(FIRST), Station(SECOND, asks_for="MISSION_REQUEST")
    link = Link(ground, [writer, reader], seed, loss=0.1, unruly=0.3)
    plans = [[some_item(100 * number + index) for index in range(20 + number)] for number in range(2)]
    for plan in plans:
        writer.upload(1, plan, ground.now_us)
        reader.download(1, ground.now_us)
        assert link.run(MINUTE_US, lambda: None not in (writer.result, reader.result))
        assert bits(ground.service.plans[1].items) == bits(plan)
        assert bits(reader.received) in ([], bits(plans[0]), bits(plans[1]))
        link.run(200_000, lambda: False)  # a late copy of a MISSION_ACK would end the next upload, at the station
    reader.download(1, ground.now_us)
    assert link.run(MINUTE_US, lambda: reader.result is not None)
    assert bits(reader.received) == bits(plans[-1])


def test_copies_do_not_breed() -> None:
    """A link that copies every datagram must not have every later item sent more and more often."""
    ground, station = Ground(), Station(FIRST)
    link = Link(ground, [station], 1, loss=0.0, unruly=1.0)
    station.upload(0, ITEMS_500[:100], 0)
    assert link.run(MINUTE_US, lambda: station.result is not None)
    assert station.result == ACCEPTED
    assert link.datagrams < 6 * 100


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

    @rule(
        peer=PEERS,
        name=st.sampled_from(["MISSION_REQUEST_INT", "MISSION_REQUEST"]),
        seq=SEQUENCES,
        plan_type=TYPES,
    )
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
        self.ground.progress = Progress(seq, mav.MISSION_STATE_ACTIVE, 1)

    @rule(after_us=st.sampled_from([0, 4_000, 250_000, 1_000_000, 5_000_000, 3600_000_000]))
    def time_passes(self, after_us: int) -> None:
        self.ground.poll(after_us)

    @invariant()
    def plans_are_as_they_were_loaded(self) -> None:
        for plan_type in PLAN_TYPES:
            loaded = [plan for kind, plan in self.ground.loaded if kind == plan_type]
            assert not loaded or self.ground.service.plans[plan_type] is loaded[-1]

    def teardown(self) -> None:
        """What was under way is over after its time; then either station uploads afresh."""
        for _ in range(25):
            self.ground.poll(250_000)
        for peer in (SECOND, FIRST):
            station = Station(peer)
            link = Link(self.ground, [station], 0, loss=0.0, unruly=0.0)
            station.upload(0, ITEMS_500[:3], self.ground.now_us)
            assert link.run(MINUTE_US, lambda station=station: station.result is not None)  # type: ignore[misc]
            assert station.result == ACCEPTED
            assert bits(self.ground.service.plans[0].items) == bits(ITEMS_500[:3])


TestConversations = Conversations.TestCase
TestConversations.settings = settings(max_examples=60, stateful_step_count=25, deadline=None)
