"""Pace of the setpoints: track time counts them, so late setpoints delay the track."""

from collections import deque

_WINDOW_US = 1_000_000


class SetpointRate:
    """Counts setpoints against those due over the last second."""

    def __init__(self) -> None:
        self._began_us = 0
        self._sent_us: deque[int] = deque()

    def begin(self, now_us: int) -> None:
        self._began_us = now_us
        self._sent_us.clear()

    def count(self, now_us: int) -> None:
        self._sent_us.append(now_us)
        while self._sent_us[0] <= now_us - _WINDOW_US:
            self._sent_us.popleft()

    def gap_s(self, now_us: int) -> float:
        last_us = self._sent_us[-1] if self._sent_us else self._began_us
        return (now_us - last_us) * 1e-6

    def kept(self, now_us: int, interval_us: int) -> float:
        """Return the computed part of the last second's setpoints; 1 in the first second."""
        if now_us - self._began_us < _WINDOW_US:
            return 1.0
        there = sum(1 for at_us in self._sent_us if at_us > now_us - _WINDOW_US)
        return there * interval_us / _WINDOW_US
