"""Link faults, reproducible by seed and time."""

from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from random import Random

from colibri.common.errors import unknown

__tracebackhide__ = True  # a failed test shows its own lines, not these

_HELD_BACK_S = 0.05
"""Largest delay of a reordered datagram."""


_MAX = {"loss": 1.0, "delay_s": inf, "jitter_s": inf, "duplicate": 1.0, "reorder": 1.0, "corrupt": 1.0, "down": True}
"""Largest value of each fault; the smallest is 0."""


@dataclass(slots=True)
class Trouble:
    """The faults of a link, drawn for each datagram; may be changed at any time.

    Attributes:
        loss: Fraction of datagrams lost.
        delay_s: Delay of each datagram.
        jitter_s: Largest additional delay.
        duplicate: Fraction delivered twice, the copy with its own delay.
        reorder: Fraction delayed so that later ones overtake.
        corrupt: Fraction with a wrong bit.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    down: bool = False

    def __setattr__(self, name: str, value: float) -> None:
        if name not in _MAX:
            raise AttributeError(unknown("fault of a link", name, sorted(_MAX)))
        if not isinstance(value, int | float) or not 0.0 <= value <= _MAX[name] or value == inf:
            limits = "from 0 on, in s" if _MAX[name] == inf else f"from 0 to {_MAX[name]:g}"
            raise ValueError(f"{name} of a link must be {limits}, not {value!r}")
        object.__setattr__(self, name, value)

    @property
    def any(self) -> bool:
        of_chance = self.loss or self.duplicate or self.reorder or self.corrupt
        return bool(of_chance or self.delay_s or self.jitter_s or self.down)


class Pipe:
    """One direction of a link; the same `seed` affects the same datagrams."""

    def __init__(self, trouble: Trouble, seed: str) -> None:
        self._trouble = trouble
        self._chance = Random(seed)
        self._waiting: list[tuple[int, int, bytes]] = []
        self._order = 0

    def put(self, datagram: bytes, now_us: int) -> None:
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
        arrived = []
        while self._waiting and self._waiting[0][0] <= now_us:
            arrived.append(heappop(self._waiting)[2])
        return [] if self._trouble.down else arrived

    @property
    def due_us(self) -> int | None:
        return self._waiting[0][0] if self._waiting else None

    def _wait(self, due_us: int, datagram: bytes) -> None:
        self._order += 1
        heappush(self._waiting, (due_us, self._order, datagram))


def spoilt(datagram: bytes, place: float) -> bytes:
    """Flip the bit at relative position `place`, 0..1."""
    if not datagram:
        return datagram
    bit = int(place * len(datagram) * 8)
    spoiled = bytearray(datagram)
    spoiled[bit // 8] ^= 1 << bit % 8
    return bytes(spoiled)
