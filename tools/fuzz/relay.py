"""A relay that hides each good datagram in a burst of bad ones from the same address."""

import random
from collections.abc import Mapping

from colibri.mavlink.wire.dialect import Codec
from tools.fuzz.datagrams import ACTUATORS, ATTITUDE, AUTOPILOT, PLANT, Fuzzer
from tools.harness.relay import Relay

UNREADABLE = ("malformed", "unknown", "truncated")
"""Counts of a codec that depend on the datagram alone."""


class FuzzingRelay(Relay):
    """A relay with an attacker in it.

    A burst goes with the first datagram of each moment: at most two wait in a receiver's buffer.
    """

    def __init__(self, plant_url: str, *, burst: int, quota: int, seed: int) -> None:
        super().__init__(plant_url)
        self._chance = random.Random(seed)
        self._fuzzers = {
            "plant": Fuzzer(self._chance, AUTOPILOT, PLANT),
            "autopilot": Fuzzer(self._chance, PLANT, AUTOPILOT),
        }
        self._twins = {"plant": Codec(*PLANT), "autopilot": Codec(*AUTOPILOT)}
        self._burst = burst
        self._quota = quota
        self._moments_us = dict.fromkeys(self._fuzzers, 0)
        self.sent = {(to, kind): 0 for to in self._fuzzers for kind in ("random", "hostile")}

    def unreadable(self, to: str) -> dict[str, int]:
        """Return the expected counts of the codec of `to` if every bad datagram arrived."""
        return unreadable(self._twins[to].dropped)

    def pass_on(self, to: str, datagram: bytes) -> None:
        moment_us = _moment_us(datagram)
        datagrams = []
        if moment_us > self._moments_us[to]:
            self._moments_us[to] = moment_us
            datagrams = self._bad(to, moment_us, datagram)
        datagrams.insert(self._chance.randint(0, len(datagrams)), datagram)
        for each in datagrams:
            self.deliver(to, each)

    def _bad(self, to: str, moment_us: int, good: bytes) -> list[bytes]:
        fuzzer, datagrams = self._fuzzers[to], []
        fuzzer.moment_us, fuzzer.good = moment_us, good
        for number in range(self._burst):
            kind = "hostile" if number % 2 else "random"
            if self.sent[to, kind] < self._quota:
                self.sent[to, kind] += 1
                datagrams.append(fuzzer.hostile() if kind == "hostile" else fuzzer.random())
                self._twins[to].decode(datagrams[-1])
        return datagrams


def unreadable(dropped: Mapping[str, int]) -> dict[str, int]:
    return {reason: dropped.get(reason, 0) for reason in UNREADABLE}


def _moment_us(datagram: bytes) -> int:
    message_id = int.from_bytes(datagram[7:10], "little")
    if message_id == ACTUATORS:
        return int.from_bytes(datagram[10:18], "little")
    if message_id == ATTITUDE:
        return int.from_bytes(datagram[10:14], "little") * 1000
    return 0
