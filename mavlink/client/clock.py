"""Estimation of the vehicle's clock offset by TIMESYNC: https://mavlink.io/en/services/timesync.html.

The quickest of recent exchanges gives the offset (clock filter of RFC 5905, section 10). An older exchange must be
quicker by the possible drift since. A significant drift, as of simulators, is compensated.
"""

from collections import deque
from collections.abc import Iterable
from math import sqrt
from statistics import median, median_high
from typing import NamedTuple

NS_PER_US = 1000
WINDOW_US = 10_000_000  # older exchanges are discarded
ENOUGH = 5
_EVERY_US = 100_000
_RESET_AFTER = 3
_RESET_US = 10_000
_DRIFT = 0.002  # uncertainty of the estimated drift, large because of simulators' clocks
_UNEVEN = 0.1  # fraction of a drift that varies with the load on the computer
_LEAST_EXCHANGES = 10  # fewest exchanges to estimate a drift from
_RATED = 10  # answers that give the rate of a clock too fast or too slow for an offset
MAX_DRIFT = 0.2  # largest plausible drift; a larger change of the offset is a restart of the vehicle
_SURE = 4.0  # significance threshold of a drift, in standard deviations


class Exchange(NamedTuple):
    """A TIMESYNC and its answer: arrival time, round trip and offset, µs."""

    received_us: int
    round_trip_us: int
    offset_us: int


class VehicleClock:
    def __init__(self) -> None:
        self._exchanges: deque[Exchange] = deque(maxlen=round(WINDOW_US / _EVERY_US))
        self._next_us: int | None = None
        self._outliers: list[Exchange] = []
        self._best: Exchange | None = None
        self._drift = 0.0
        self.known = False
        self.round_trip_us = 0
        self.answered_us: int | None = None
        self._answers: deque[tuple[int, int]] = deque(maxlen=_RATED)

    @property
    def rate(self) -> float:
        """Return the rate of the vehicle's clock relative to the own; 1 if unknown."""
        if len(self._answers) < _RATED:
            return 1.0
        (began_us, began), (ended_us, ended) = self._answers[0], self._answers[-1]
        return (ended - began) / max(ended_us - began_us, 1)

    def own_us(self, vehicle_us: int) -> int:
        """Convert a time of the vehicle's clock to the own; raise `ValueError` before the first exchange."""
        if self._best is None:
            raise ValueError("no TIMESYNC has been answered")
        own_us = vehicle_us - self._best.offset_us
        return own_us - round(self._drift * (own_us - self._best.received_us))

    def request(self, now_us: int) -> tuple[int, int] | None:
        if self._next_us is not None and now_us < self._next_us:
            return None
        self._next_us = now_us + _EVERY_US
        return (0, now_us * NS_PER_US)

    def receive(self, tc1: int, ts1: int, now_us: int) -> None:
        """Read a TIMESYNC; requests and unsolicited answers are ignored."""
        sent_us = ts1 // NS_PER_US
        if tc1 == 0 or not now_us - WINDOW_US <= sent_us <= now_us:
            return
        self.answered_us = now_us
        self._answers.append(((sent_us + now_us) // 2, tc1 // NS_PER_US))
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
        self.known = self.known or len(self._exchanges) >= ENOUGH
        self.round_trip_us = median_high(exchange.round_trip_us for exchange in self._exchanges)
        self._drift = drift_of(self._exchanges)
        unsure = _DRIFT + _UNEVEN * abs(self._drift)
        self._best = min(self._exchanges, key=lambda it: 0.5 * it.round_trip_us + unsure * (now_us - it.received_us))

    def _contradicts(self, exchange: Exchange) -> bool:
        best = self._best
        if best is None:
            return False
        explained_us = (exchange.round_trip_us + best.round_trip_us) // 2 + _RESET_US
        drifted_us = MAX_DRIFT * (exchange.received_us - best.received_us)
        return abs(exchange.offset_us - best.offset_us) > explained_us + drifted_us


def drift_of(exchanges: Iterable[Exchange]) -> float:
    """Return the relative drift of the vehicle's clock, positive if fast, by Theil and Sen; 0 if insignificant."""
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
    return drift if _SURE * uncertain < abs(drift) <= MAX_DRIFT else 0.0
