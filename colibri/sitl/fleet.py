"""Several vehicles at once, each with a plant, an autopilot and ground stations of its own, in one simulated time."""

from collections.abc import Callable

from colibri.sitl.vehicle import NotInTimeError, Sitl


class Fleet(tuple[Sitl, ...]):
    """Vehicles whose time goes on together: none is ever more than a frame ahead."""

    __slots__ = ()

    def run(self, seconds: float) -> None:
        """Let simulated time pass."""
        end_us = self._now_us() + round(seconds * 1e6)
        while self._now_us() < end_us:
            self.step()

    def wait_until(self, predicate: Callable[[], object], *, within: float, what: str = "") -> None:
        """Fly until `predicate()`.

        Raises:
            NotInTimeError: It is not so `within` that many seconds of simulated time.
        """
        end_us = self._now_us() + round(within * 1e6)
        while not predicate():
            if self._now_us() >= end_us:
                who = "; ".join(f"vehicle {sitl.system}: {sitl}" for sitl in self)
                raise NotInTimeError(f"{what or 'what was waited for'} took longer than {within:g} s: {who}")
            self.step()

    def step(self) -> None:
        """Fly one frame of whoever is behind."""
        behind_us = self._now_us()
        for sitl in self:
            if sitl.time_us == behind_us:
                sitl.step()

    def _now_us(self) -> int:
        return min(sitl.time_us for sitl in self)
