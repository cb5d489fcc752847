"""A companion and a vehicle of `colibri sitl`, in memory and in lockstep: no sockets, no clock."""

from collections.abc import Callable, Mapping
from typing import Any, Generic, Self, TypeVar

from colibri.autopilot.control.interface import Clock, Controller
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import load_controller
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.companion.guide import Companion
from colibri.companion.settings import CompanionSettings
from colibri.companion.supervision.phases import CompanionEnd, CompanionPhase
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from colibri.sitl.backends.link_faults import Pipe, Trouble
from colibri.sitl.vehicle import Sitl
from tests.colibri.companion.stand_in import StandIn

AHEAD_US = 7_654_321  # the companion's clock is ahead of the vehicle's by this
NO_LAW_CLOCK = 0.0


class Mutinous:
    def __init__(self) -> None:
        self.raises = False

    def __call__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> Controller[Any]:
        law = load_controller(load_profile("flight").controller)(table, vehicle, clock)
        step = law.step

        def mutinous(*args: Any) -> Any:
            if self.raises:
                raise ArithmeticError("no more")
            return step(*args)

        law.step = mutinous  # type: ignore[method-assign, assignment]
        return law


Flown = TypeVar("Flown", Sitl, StandIn)


class Ride(Generic[Flown]):
    """A companion on a link of its own to a vehicle.

    Attributes:
        trouble: What the link does; may be changed at any time.
        sent: When and what the companion has sent, before the link.
        polls_every_us: How seldom the computer gets round to the companion.
    """

    def __init__(
        self,
        sitl: Flown,
        track: str | Track = "spiral",
        settings: CompanionSettings | None = None,
        *,
        trouble: Trouble | None = None,
        seed: int = 0,
        profile: str = "flight",
    ) -> None:
        self.sitl: Flown = sitl
        loaded, vehicle = load_profile(profile), load_vehicle("hummingbird")
        path = load_track(track, vehicle, loaded).track if isinstance(track, str) else track
        settings = settings or CompanionSettings(may_arm=True)
        self.law = Mutinous()
        law = self.law if profile == "flight" else None
        self.companion = Companion(settings, loaded, vehicle, path, lambda: NO_LAW_CLOCK, law)
        self.trouble = trouble or Trouble()
        self._up, self._down = Pipe(self.trouble, f"{seed} up"), Pipe(self.trouble, f"{seed} down")
        self._port: StandIn | Port = sitl if isinstance(sitl, StandIn) else Port(sitl)
        self.sent: list[tuple[int, bytes]] = []
        self.history: list[tuple[float, CompanionPhase]] = []
        self.polls_every_us = 0
        self._polled_us = -1

    @property
    def now_us(self) -> int:
        return self.sitl.time_us + AHEAD_US

    def step(self) -> None:
        now_us = self.now_us
        for datagram in self._down.due(now_us):
            self.companion.receive(datagram, now_us)
        if now_us - self._polled_us >= self.polls_every_us:
            self._polled_us = now_us
            for frame in self.companion.poll(now_us):
                self.sent.append((now_us, frame))
                self._up.put(frame, now_us)
        if not self.history or self.history[-1][1] is not self.companion.phase:
            self.history.append((self.sitl.time_s, self.companion.phase))
        self._port.carry(self._up.due(now_us))
        self.sitl.step()
        for datagram in self._port.take():
            self._down.put(datagram, self.now_us)

    def until(self, condition: Callable[[], object], within_s: float) -> None:
        ends_s = self.sitl.time_s + within_s
        while not condition():
            assert self.sitl.time_s < ends_s, (self.companion.phase, self.companion.said, self.companion.failing)
            self.step()

    def flying(self, within_s: float) -> Self:
        self.until(lambda: self.companion.phase is CompanionPhase.FLYING, within_s)
        return self

    def to_the_end(self, within_s: float) -> CompanionEnd:
        self.until(lambda: self.companion.ended is not None, within_s)
        assert self.companion.ended
        return self.companion.ended


class Port:
    """The vehicle's end of the link: a station without a voice of its own."""

    def __init__(self, sitl: Sitl) -> None:
        station = sitl.client(250, 250, beats=False)
        self._to_vehicle: list[bytes] = []
        self._from_vehicle: list[bytes] = []
        station.arriving = self._arriving  # type: ignore[method-assign]
        station.departing = self._departing  # type: ignore[method-assign]

    def carry(self, datagrams: list[bytes]) -> None:
        self._to_vehicle.extend(datagrams)

    def take(self) -> list[bytes]:
        taken, self._from_vehicle = self._from_vehicle, []
        return taken

    def _arriving(self, datagram: bytes, now_us: int) -> None:
        del now_us
        self._from_vehicle.append(datagram)

    def _departing(self, now_us: int) -> list[bytes]:
        del now_us
        taken, self._to_vehicle = self._to_vehicle, []
        return taken
