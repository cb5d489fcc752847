"""Due times of messages per channel, without drift and bursts."""

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import TypeAlias

Key: TypeAlias = tuple[int, str]  # number of a channel, name of a message

GOLDEN = 0.6180339887498949  # the fractional parts of its multiples are evenly spread
STALE_ALLOWED = 64


@dataclass(slots=True, eq=False)
class _Entry:
    key: Key
    interval_us: int
    phase_us: int
    live: bool = True

    def after(self, now_us: int) -> int:
        return now_us + self.interval_us - (now_us - self.phase_us) % self.interval_us


class Schedule:
    """Due keys; those of the same interval and phase are due together."""

    def __init__(self) -> None:
        self._entries: dict[Key, _Entry] = {}
        self._heap: list[tuple[int, int, _Entry]] = []
        self._count = 0
        self._now_us = 0

    def set(self, key: Key, interval_us: int, spread: int, now_us: int) -> None:
        """Make `key` due every `interval_us` (> 0); `spread` numbers the phases."""
        entry = self._entries.get(key)
        if entry is not None and entry.interval_us == interval_us:
            return
        self.drop(key)
        phase_us = int(interval_us * (spread * GOLDEN % 1.0))
        self._entries[key] = entry = _Entry(key, interval_us, phase_us)
        self._push(entry, now_us)
        if len(self._heap) > 2 * len(self._entries) + STALE_ALLOWED:
            self._rebuild(now_us)

    def drop(self, key: Key) -> None:
        entry = self._entries.pop(key, None)
        if entry is not None:
            entry.live = False

    def interval_us(self, key: Key) -> int | None:
        entry = self._entries.get(key)
        return None if entry is None else entry.interval_us

    def due(self, now_us: int, at_most: int) -> list[Key]:
        """Return keys due since the last call, in order of their times; those beyond `at_most` wait."""
        heap = self._heap
        if now_us < self._now_us:  # a new flight has begun
            self._rebuild(now_us)
        self._now_us = now_us
        if not heap or heap[0][0] > now_us:
            return []
        keys: list[Key] = []
        while heap and heap[0][0] <= now_us and len(keys) < at_most:
            entry = heappop(heap)[2]
            if entry.live:
                keys.append(entry.key)
                self._push(entry, now_us)
        return keys

    def _push(self, entry: _Entry, now_us: int) -> None:
        self._count += 1
        heappush(self._heap, (entry.after(now_us), self._count, entry))

    def _rebuild(self, now_us: int) -> None:
        entries = self._entries.values()
        self._heap[:] = [(entry.after(now_us), number, entry) for number, entry in enumerate(entries)]
        self._count = len(self._heap)
        heapify(self._heap)
