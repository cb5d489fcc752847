"""The vehicle's clock by TIMESYNC: its offset, and how long messages are on their way.

Of the exchanges of the last seconds the one that was quickest tells the offset: what delayed the others was jitter,
which is all in one of their two ways (the clock filter of RFC 5905, section 10). An older one must have been so much
quicker as the clocks may have drifted apart since. A simulator's clock may go wrong by percents: where the exchanges
show it, they are taken at their drift. https://mavlink.io/en/services/timesync.html
"""

from collections import deque
from collections.abc import Iterable
from math import sqrt
from statistics import median
from typing import NamedTuple

NS_PER_US = 1000
WINDOW_US = 10_000_000
"""Exchanges older than this count no more: the clocks drift apart by microseconds a second."""
ENOUGH = 5
_EVERY_US = 100_000
_RESET_AFTER = 3
_RESET_US = 10_000
_DRIFT = 0.002
"""By which clocks may differ beside the drift that is known: a simulator's is not a quartz."""
_UNEVEN = 0.1
"""Part of a drift that comes and goes: such a clock is held up by whatever else its computer does."""
_LEAST_EXCHANGES = 10
"""Fewer tell no drift."""
_MAX_DRIFT = 0.2
"""No larger one is believed; an offset that has changed by more is that of a vehicle that was started again."""
_SURE = 4.0
"""So many times its uncertainty a drift must be, to be one."""


class Exchange(NamedTuple):
    """One TIMESYNC and its answer: when it came back, how long that took, and the offset it tells, µs."""

    received_us: int
    round_trip_us: int
    offset_us: int


class VehicleClock:
    """Keeps the offset of the vehicle's clock."""

    def __init__(self) -> None:
        """Begin knowing nothing."""
        self._exchanges: deque[Exchange] = deque(maxlen=round(WINDOW_US / _EVERY_US))
        self._next_us: int | None = None
        self._outliers: list[Exchange] = []
        self._best: Exchange | None = None
        self._drift = 0.0
        self._known = False

    @property
    def known(self) -> bool:
        """Whether there were exchanges enough."""
        return self._known

    @property
    def round_trip_us(self) -> int:
        """The median time to the vehicle and back, µs; 0 before the first exchange."""
        trips = sorted(exchange.round_trip_us for exchange in self._exchanges)
        return trips[len(trips) // 2] if trips else 0

    def own_us(self, vehicle_us: int) -> int:
        """Return the own time of a time of the vehicle's; before the first exchange there is none.

        Raises:
            ValueError: There was no exchange.
        """
        if self._best is None:
            raise ValueError("no TIMESYNC has been answered")
        own_us = vehicle_us - self._best.offset_us
        return own_us - round(self._drift * (own_us - self._best.received_us))

    def request(self, now_us: int) -> tuple[int, int] | None:
        """Return the fields of a TIMESYNC if one is due."""
        if self._next_us is not None and now_us < self._next_us:
            return None
        self._next_us = now_us + _EVERY_US
        return (0, now_us * NS_PER_US)

    def receive(self, tc1: int, ts1: int, now_us: int) -> None:
        """Take in a TIMESYNC; one that asks, or answers what was never sent, counts for nothing."""
        sent_us = ts1 // NS_PER_US
        if tc1 == 0 or not now_us - WINDOW_US <= sent_us <= now_us:
            return
        exchange = Exchange(now_us, now_us - sent_us, tc1 // NS_PER_US - (sent_us + now_us) // 2)
        if self._contradicts(exchange):
            self._outliers.append(exchange)
            if len(self._outliers) < _RESET_AFTER:
                return
            self._exchanges.clear()
            self._exchanges.extend(self._outliers)
        else:
            self._exchanges.append(exchange)
        self._outliers.clear()
        while self._exchanges[0].received_us < now_us - WINDOW_US:
            self._exchanges.popleft()
        self._known = self._known or len(self._exchanges) >= ENOUGH
        self._drift = drift_of(self._exchanges)
        unsure = _DRIFT + _UNEVEN * abs(self._drift)
        self._best = min(self._exchanges, key=lambda it: 0.5 * it.round_trip_us + unsure * (now_us - it.received_us))

    def _contradicts(self, exchange: Exchange) -> bool:
        """Whether no delays explain an exchange beside the best: the vehicle was started again."""
        best = self._best
        if best is None:
            return False
        explained_us = (exchange.round_trip_us + best.round_trip_us) // 2 + _RESET_US
        drifted_us = _MAX_DRIFT * (exchange.received_us - best.received_us)
        return abs(exchange.offset_us - best.offset_us) > explained_us + drifted_us


def drift_of(exchanges: Iterable[Exchange]) -> float:
    """Return by how much the vehicle's clock is faster, in parts of the own; 0 where that is not sure.

    The median slope between exchanges that are half of all apart (Theil and Sen).
    """
    told = tuple(exchanges)
    half = len(told) // 2
    if len(told) < _LEAST_EXCHANGES:
        return 0.0
    slopes = [
        (late.offset_us - early.offset_us) / max(late.received_us - early.received_us, 1)
        for early, late in zip(told, told[half:], strict=False)
    ]
    drift = median(slopes)
    uncertain = median(abs(slope - drift) for slope in slopes) / sqrt(half)
    return drift if _SURE * uncertain < abs(drift) <= _MAX_DRIFT else 0.0
