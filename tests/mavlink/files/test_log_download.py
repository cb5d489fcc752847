import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.files import log_download
from colibri.mavlink.files.log_download import BLOCK_BYTES, MESSAGES_A_POLL, Logs
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.wire.dialect import Message
from tests.support.messages import GROUND, OTHER, message, on_the_wire

CHUNK = 128 * BLOCK_BYTES  # what MAVSDK asks for at once
ALL = 0xFFFFFFFF
BIG = random.Random(1).randbytes(30_001)
CONTENT = {"00001.ulg": BIG, "00002.ulg": b"", "00003.ulg": bytes(range(180))}


@pytest.fixture
def memory() -> MemoryFiles:
    memory = MemoryFiles()
    memory.make_folder(("logs",))
    memory.make_folder(("logs", "no log"))
    for name, data in CONTENT.items():
        memory.create(("logs", name))
        memory.write(("logs", name), 0, data)
    return memory


@pytest.fixture
def logs(memory: MemoryFiles) -> Logs:
    return Logs(memory, ("logs",))


def ask(logs: Logs, name: str, *fields: Any, peer: Peer = GROUND) -> list[Send]:
    return list(logs.receive(message(name, 1, 1, *fields, peer=peer), peer, 0))


def drain(logs: Logs, sends: list[Send]) -> list[Send]:
    while True:
        more = list(logs.poll(0))
        assert len(more) <= 2 * MESSAGES_A_POLL
        if not more:
            return sends
        sends = sends + more


def entries(logs: Logs, start: int = 0, end: int = 0xFFFF, peer: Peer = GROUND) -> list[tuple[int, ...]]:
    sends = drain(logs, ask(logs, "LOG_REQUEST_LIST", start, end, peer=peer))
    assert all(send.channel == peer.channel for send in sends)
    found = [sent.fields for sent in on_the_wire(sends)]
    return [(entry.id, entry.num_logs, entry.last_log_num, entry.time_utc, entry.size) for entry in found]


def blocks(sends: list[Send]) -> list[tuple[int, int, bytes]]:
    found = [sent.fields for sent in on_the_wire(sends)]
    return [(block.id, block.ofs, bytes(block.data[: block.count])) for block in found]


def data(logs: Logs, number: int, offset: int, count: int, peer: Peer = GROUND) -> list[tuple[int, int, bytes]]:
    return blocks(drain(logs, ask(logs, "LOG_REQUEST_DATA", number, offset, count, peer=peer)))


def test_ids_may_begin_at_one(memory: MemoryFiles) -> None:
    memory.create(("logs", "00000001.BIN"))
    memory.create(("logs", "00000002.BIN"))
    memory.write(("logs", "00000002.BIN"), 0, b"two")
    logs = Logs(memory, ("logs",), suffix=".BIN", first_id=1)
    assert entries(logs) == [(1, 2, 2, 0, 0), (2, 2, 2, 0, 3)]
    assert entries(logs, 2, 2) == [(2, 2, 2, 0, 3)]
    assert data(logs, 2, 0, ALL) == [(2, 0, b"two")]
    assert data(logs, 0, 0, ALL) == [(0, 0, b"")]


def test_logs_are_listed(logs: Logs) -> None:
    assert entries(logs) == [(0, 3, 2, 0, 30_001), (1, 3, 2, 0, 0), (2, 3, 2, 0, 180)]
    assert entries(logs, 1, 1) == [(1, 3, 2, 0, 0)]
    assert entries(logs, 2, 9) == [(2, 3, 2, 0, 180)]
    assert entries(logs, 5, 9) == entries(logs, 2, 1) == []


@pytest.mark.parametrize("folder", [("logs",), ("nope",)])
def test_without_logs_one_entry_says_so(folder: tuple[str, ...]) -> None:
    memory = MemoryFiles()
    memory.make_folder(("logs",))
    assert entries(Logs(memory, folder)) == [(0, 0, 0, 0, 0)]


def test_a_list_is_paced(memory: MemoryFiles, logs: Logs) -> None:
    for number in range(100):
        memory.create(("logs", f"1{number:04}.ulg"))
    ask(logs, "LOG_REQUEST_LIST", 0, 0xFFFF)
    assert len(list(logs.poll(0))) == MESSAGES_A_POLL
    assert [entry[0] for entry in entries(logs)] == list(range(103))


def test_a_chunk_is_sent_fast_and_a_whole_log_slowly(logs: Logs) -> None:
    ask(logs, "LOG_REQUEST_DATA", 0, 0, CHUNK)
    assert len(list(logs.poll(0))) == MESSAGES_A_POLL
    ask(logs, "LOG_REQUEST_END")
    ask(logs, "LOG_REQUEST_DATA", 0, 0, ALL)
    assert len(list(logs.poll(0))) == log_download.MESSAGES_A_POLL_OF_A_LONG_PART


def test_a_whole_log_ends_with_a_block_that_is_not_full(logs: Logs) -> None:
    found = data(logs, 0, 0, ALL)
    assert b"".join(block for _, _, block in found) == BIG
    assert [len(block) for _, _, block in found][-2:] == [BLOCK_BYTES, 30_001 % BLOCK_BYTES]


def test_where_the_last_block_is_full_an_empty_one_follows(logs: Logs) -> None:
    assert data(logs, 2, 0, ALL) == [(2, 0, bytes(range(90))), (2, 90, bytes(range(90, 180))), (2, 180, b"")]
    assert data(logs, 2, 0, 180)[-1] == (2, 90, bytes(range(90, 180)))  # as much as was asked for: no more to say


@pytest.mark.parametrize(
    ("number", "offset", "count"), [(1, 0, 90), (2, 180, 90), (2, ALL, ALL), (2, 0, 0), (9, 7, 90)]
)
def test_where_there_is_nothing_an_empty_block_says_so(logs: Logs, number: int, offset: int, count: int) -> None:
    assert data(logs, number, offset, count) == [(number, offset, b"")]


def test_several_parts_come_by_turns(logs: Logs) -> None:
    for offset in range(0, 900, 180):
        ask(logs, "LOG_REQUEST_DATA", 0, offset, 90)
    ask(logs, "LOG_REQUEST_DATA", 0, 0, 180, peer=OTHER)
    sends = drain(logs, [])
    mine = [send for send in sends if send.channel == GROUND.channel]
    assert [(offset, block) for _, offset, block in blocks(mine)] == [(o, BIG[o : o + 90]) for o in range(0, 900, 180)]
    others = blocks([send for send in sends if send.channel == OTHER.channel])
    assert b"".join(block for _, _, block in others) == BIG[:180]


def test_the_same_asked_again_is_not_sent_twice(logs: Logs) -> None:
    ask(logs, "LOG_REQUEST_DATA", 0, 0, CHUNK)
    ask(logs, "LOG_REQUEST_DATA", 0, 0, CHUNK)
    assert len(drain(logs, [])) == 128


def test_another_log_or_the_end_stops_a_download(logs: Logs) -> None:
    ask(logs, "LOG_REQUEST_DATA", 0, 0, ALL)
    ask(logs, "LOG_REQUEST_DATA", 0, 0, ALL, peer=OTHER)
    ask(logs, "LOG_REQUEST_DATA", 2, 0, 180)
    sends = list(logs.poll(0))
    assert {number for number, _, _ in blocks([send for send in sends if send.channel == GROUND.channel])} == {2}
    assert {number for number, _, _ in blocks([send for send in sends if send.channel == OTHER.channel])} == {0}
    ask(logs, "LOG_REQUEST_END", peer=OTHER)
    assert drain(logs, []) == []


def test_ids_are_those_of_the_last_list(memory: MemoryFiles, logs: Logs) -> None:
    entries(logs)
    memory.remove(("logs", "00001.ulg"))
    assert data(logs, 2, 0, 90) == [(2, 0, bytes(range(90)))]
    assert data(logs, 0, 0, 90) == [(0, 0, b"")]
    assert entries(logs) == [(0, 2, 1, 0, 0), (1, 2, 1, 0, 180)]
    assert data(logs, 1, 0, 90) == [(1, 0, bytes(range(90)))]


def test_a_log_that_vanishes_ends(memory: MemoryFiles, logs: Logs) -> None:
    ask(logs, "LOG_REQUEST_DATA", 0, 0, CHUNK)
    list(logs.poll(0))
    memory.remove(("logs", "00001.ulg"))
    assert blocks(drain(logs, [])) == [(0, MESSAGES_A_POLL * BLOCK_BYTES, b"")]


def test_logs_are_erased_but_for_the_one_being_written(memory: MemoryFiles) -> None:
    logs = Logs(memory, ("logs",), lambda: "00003.ulg")
    ask(logs, "LOG_REQUEST_DATA", 0, 0, ALL)
    ask(logs, "LOG_ERASE")
    assert drain(logs, []) == []
    assert entries(logs) == [(0, 1, 0, 0, 180)]
    assert [entry.name for entry in memory.list(("logs",))] == ["00003.ulg", "no log"]


def test_many_ids_of_one_channel_end_nobody_elses_download(logs: Logs) -> None:
    sends = ask(logs, "LOG_REQUEST_DATA", 0, 0, ALL)
    for system in range(1, 2 * log_download.MAX_PEERS):
        ask(logs, "LOG_REQUEST_LIST", 0, 0, peer=Peer(9, system, 1))
    sends = [send for send in drain(logs, sends) if send.channel == GROUND.channel]
    assert b"".join(data for _, _, data in blocks(sends)) == BIG


def test_memory_is_bounded(logs: Logs) -> None:
    for number in range(50):
        for offset in range(40):
            ask(logs, "LOG_REQUEST_DATA", 0, offset, ALL, peer=Peer(number, number, 1))
        ask(logs, "LOG_REQUEST_LIST", 0, 0xFFFF, peer=Peer(number, number, 1))
    assert len(logs._shown) <= log_download.MAX_PEERS  # noqa: SLF001
    assert len(logs._listings) <= log_download.MAX_PEERS  # noqa: SLF001
    assert len(logs._transfers) <= log_download.MAX_PEERS * log_download.MAX_TRANSFERS_OF_A_PEER  # noqa: SLF001


U16, U32 = st.integers(0, 0xFFFF) | st.integers(0, 4), st.integers(0, ALL) | st.integers(0, 200)
REQUESTS = st.one_of(
    st.builds(lambda *f: message("LOG_REQUEST_LIST", 1, 1, *f), U16, U16),
    st.builds(lambda *f: message("LOG_REQUEST_DATA", 1, 1, *f), U16, U32, U32),
    st.sampled_from([message("LOG_ERASE", 1, 1), message("LOG_REQUEST_END", 1, 1)]),
)


@given(st.lists(st.tuples(REQUESTS, st.sampled_from([GROUND, OTHER])), max_size=30))
def test_nothing_that_is_asked_raises(requests: list[tuple[Message, Peer]]) -> None:
    memory = MemoryFiles()
    memory.create(("a",))
    memory.write(("a",), 0, b"x" * 300)
    logs = Logs(memory)
    for request, peer in requests:
        on_the_wire([*logs.receive(request, peer, 0), *logs.poll(0)])
    drain(logs, [])
