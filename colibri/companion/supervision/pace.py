"""How well a companion keeps its pace: the time of the track counts setpoints, so late ones make it fly behind."""

from collections import deque

_WINDOW_US = 1_000_000


class Pace:
    """Counts setpoints against those that were due over the last second."""

    def __init__(self) -> None:
        """Begin without a setpoint: nothing is late."""
        self._began_us = 0
        self._sent_us: deque[int] = deque()

    def begin(self, now_us: int) -> None:
        """Begin to count; what was before does not count."""
        self._began_us = now_us
        self._sent_us.clear()

    def count(self, now_us: int) -> None:
        """Take in that a setpoint was computed."""
        self._sent_us.append(now_us)
        while self._sent_us[0] <= now_us - _WINDOW_US:
            self._sent_us.popleft()

    def gap_s(self, now_us: int) -> float:
        """Return the time since the last setpoint, s."""
        last_us = self._sent_us[-1] if self._sent_us else self._began_us
        return (now_us - last_us) * 1e-6

    def kept(self, now_us: int, interval_us: int) -> float:
        """Return which part of the setpoints of the last second there was, one an interval; 1 in the first second."""
        if now_us - self._began_us < _WINDOW_US:
            return 1.0
        there = sum(1 for at_us in self._sent_us if at_us > now_us - _WINDOW_US)
        return there * interval_us / _WINDOW_US
