"""The clock of a recorded flight: plays, pauses, goes faster or slower, jumps. Pure: the wall clock is an argument."""

from typing import NamedTuple

SPEEDS = ("0.1x", "0.25x", "0.5x", "1x", "2x", "4x", "8x")


class Playback(NamedTuple):
    """Where in a flight the page is.

    Attributes:
        span_s: From when to when the flight is known.
        since_s: When by the wall clock it was at `from_s`.
        from_s: Time of the flight.
        speed: Times real time.
        plays: Whether it goes on.
    """

    span_s: tuple[float, float]
    since_s: float = 0.0
    from_s: float = 0.0
    speed: float = 1.0
    plays: bool = False

    def time_s(self, now_s: float) -> float:
        """Return the time of the flight, which stops at its end."""
        ahead_s = self.speed * (now_s - self.since_s) if self.plays else 0.0
        return min(max(self.from_s + ahead_s, self.span_s[0]), self.span_s[1])

    def is_over(self, now_s: float) -> bool:
        """Whether it stands at the end of the flight."""
        return self.time_s(now_s) >= self.span_s[1]

    def play(self, now_s: float) -> "Playback":
        """Return it playing on; from the beginning where it is over."""
        start_s = self.span_s[0] if self.is_over(now_s) else self.time_s(now_s)
        return self._replace(since_s=now_s, from_s=start_s, plays=True)

    def pause(self, now_s: float) -> "Playback":
        """Return it standing where it is."""
        return self._replace(since_s=now_s, from_s=self.time_s(now_s), plays=False)

    def seek(self, time_s: float, now_s: float) -> "Playback":
        """Return it at another time, playing if it plays."""
        return self._replace(since_s=now_s, from_s=time_s)

    def at_speed(self, speed: float, now_s: float) -> "Playback":
        """Return it at another speed, from where it is."""
        return self._replace(since_s=now_s, from_s=self.time_s(now_s), speed=speed)


def speed_of(text: str) -> float:
    """Return what one of `SPEEDS` says."""
    return float(text.removesuffix("x"))
