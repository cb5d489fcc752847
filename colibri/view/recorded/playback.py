"""The clock of a recorded flight."""

from typing import NamedTuple

SPEEDS = ("0.1x", "0.25x", "0.5x", "1x", "2x", "4x", "8x")


class Playback(NamedTuple):
    """The position in a flight; it was at `from_s` at wall-clock time `since_s`."""

    span_s: tuple[float, float]
    since_s: float = 0.0
    from_s: float = 0.0
    speed: float = 1.0
    plays: bool = False

    def time_s(self, now_s: float) -> float:
        ahead_s = self.speed * (now_s - self.since_s) if self.plays else 0.0
        return min(max(self.from_s + ahead_s, self.span_s[0]), self.span_s[1])

    def is_over(self, now_s: float) -> bool:
        return self.time_s(now_s) >= self.span_s[1]

    def play(self, now_s: float) -> "Playback":
        """Start playing; at the end, from the beginning."""
        start_s = self.span_s[0] if self.is_over(now_s) else self.time_s(now_s)
        return self._replace(since_s=now_s, from_s=start_s, plays=True)

    def pause(self, now_s: float) -> "Playback":
        return self._replace(since_s=now_s, from_s=self.time_s(now_s), plays=False)

    def seek(self, time_s: float, now_s: float) -> "Playback":
        return self._replace(since_s=now_s, from_s=time_s)

    def at_speed(self, speed: float, now_s: float) -> "Playback":
        return self._replace(since_s=now_s, from_s=self.time_s(now_s), speed=speed)


def speed_of(text: str) -> float:
    return float(text.removesuffix("x"))
