"""Frames whose time does not follow: a few are strays; many in sequence are a clock that was reset."""

MAX_GAP_US = 1_000_000
_SETTLED = 25


class ClockResets:
    """Counts frames that follow one another, and not the clock that is kept."""

    def __init__(self) -> None:
        """Begin with none."""
        self._time_us: int | None = None
        self._count = 0

    def settle(self, time_us: int) -> bool:
        """Take the time of a stray frame; return whether enough of them agree on another clock."""
        follows = self._time_us is not None and 0 < time_us - self._time_us <= MAX_GAP_US
        self._count = self._count + 1 if follows else 1
        self._time_us = time_us
        return self._count >= _SETTLED

    def clear(self) -> None:
        """Forget them: a frame has followed the clock that is kept."""
        self._time_us = None
        self._count = 0
