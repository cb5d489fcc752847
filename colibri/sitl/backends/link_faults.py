"""Faults of a link: loss, delay, duplication, reordering and corruption of datagrams, by seed and simulated time."""

from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from random import Random

_HELD_BACK_S = 0.05
"""For so long, at most, a datagram is held back so that others overtake it."""


_MAX = {"loss": 1.0, "delay_s": inf, "jitter_s": inf, "duplicate": 1.0, "reorder": 1.0, "corrupt": 1.0, "down": True}
"""What a link does, and the largest value of each; the smallest is 0."""


@dataclass(slots=True)
class Trouble:
    """What a link does, to each datagram by itself. May be changed at any time, to what it can be.

    Attributes:
        loss: Part of the datagrams that never arrive.
        delay_s: How long each takes.
        jitter_s: How much longer at most.
        duplicate: Part that arrives twice, the second time with a delay of its own.
        reorder: Part that is held back, so that others overtake it.
        corrupt: Part in which a bit is wrong.
        down: Whether nothing arrives.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    down: bool = False

    def __setattr__(self, name: str, value: float) -> None:
        """Change what the link does.

        Raises:
            AttributeError: A link has no such attribute.
            ValueError: It cannot have that value.
        """
        if name not in _MAX:
            raise AttributeError(f"a link has no {name}: choose {', '.join(sorted(_MAX))}")
        if not isinstance(value, int | float) or not 0.0 <= value <= _MAX[name] or value == inf:
            limits = "from 0 on, in s" if _MAX[name] == inf else f"from 0 to {_MAX[name]:g}"
            raise ValueError(f"{name} of a link must be {limits}, not {value!r}")
        object.__setattr__(self, name, value)

    @property
    def any(self) -> bool:
        """Whether it does anything at all."""
        of_chance = self.loss or self.duplicate or self.reorder or self.corrupt
        return bool(of_chance or self.delay_s or self.jitter_s or self.down)


class Pipe:
    """One direction of a link."""

    def __init__(self, trouble: Trouble, seed: str) -> None:
        """Apply `trouble` to datagrams; the same `seed` affects the same datagrams."""
        self._trouble = trouble
        self._chance = Random(seed)
        self._waiting: list[tuple[int, int, bytes]] = []
        self._order = 0

    def put(self, datagram: bytes, now_us: int) -> None:
        """Send a datagram."""
        trouble, chance = self._trouble, self._chance
        if not trouble.any:
            self._wait(now_us, datagram)
            return
        lost, twice, held, spoiled, first, second, late, place = (chance.random() for _ in range(8))
        if trouble.down or lost < trouble.loss:
            return
        if spoiled < trouble.corrupt:
            datagram = spoilt(datagram, place)
        delay_s = trouble.delay_s + first * trouble.jitter_s + (late * _HELD_BACK_S if held < trouble.reorder else 0.0)
        self._wait(now_us + round(delay_s * 1e6), datagram)
        if twice < trouble.duplicate:
            self._wait(now_us + round((trouble.delay_s + second * trouble.jitter_s) * 1e6), datagram)

    def due(self, now_us: int) -> list[bytes]:
        """Return what arrives up to `now_us`."""
        arrived = []
        while self._waiting and self._waiting[0][0] <= now_us:
            arrived.append(heappop(self._waiting)[2])
        return [] if self._trouble.down else arrived

    @property
    def due_us(self) -> int | None:
        """When something arrives next; None where nothing is on its way."""
        return self._waiting[0][0] if self._waiting else None

    def _wait(self, due_us: int, datagram: bytes) -> None:
        self._order += 1
        heappush(self._waiting, (due_us, self._order, datagram))


def spoilt(datagram: bytes, place: float) -> bytes:
    """Return a datagram with one bit wrong, the one at `place` of 0..1."""
    if not datagram:
        return datagram
    bit = int(place * len(datagram) * 8)
    spoiled = bytearray(datagram)
    spoiled[bit // 8] ^= 1 << bit % 8
    return bytes(spoiled)
