"""The thesis's spiral flown in this process, with or without fire on the wire."""

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.track_stages import track_autopilot
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.flights.flight import InMemory, SteppedFlight
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.physics.start import default_starts
from colibri.plant.physics.world import State
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle
from tools.fuzz.datagrams import FRAME_US, Fuzzer

NOW_S = 0.0


class HostileWire(InMemory):
    """A wire with `burst` hostile datagrams before and after each good one."""

    def __init__(self, burst: int = 0, fuzzers: tuple[Fuzzer, Fuzzer] | None = None) -> None:
        self._burst, self._fuzzers, self._now_us = burst, fuzzers, 0
        super().__init__(FRAME_US, Feedback.STATE, traffic=lambda *_: None)  # every frame is a datagram then

    def carried_up(self, datagrams: list[bytes]) -> list[bytes]:
        return self._among(datagrams, 1)

    def carried_down(self, datagrams: list[bytes]) -> list[bytes]:
        return self._among(datagrams, 0)

    def at(self, now_us: int) -> None:
        self._now_us = now_us

    def _among(self, datagrams: list[bytes], which: int) -> list[bytes]:
        if not (self._fuzzers and self._now_us):
            return datagrams
        fuzzer = self._fuzzers[which]
        fuzzer.moment_us = self._now_us
        before, after = ([fuzzer.hostile() for _ in range(self._burst)] for _ in range(2))
        return [*before, *datagrams, *after]


def fly(frames: int, wire: HostileWire) -> list[State]:
    profile = load_profile("thesis")
    vehicle = load_vehicle(profile.simulation.vehicle)
    autopilot = track_autopilot(profile, vehicle, track("spiral"), lambda: NOW_S)
    builder = PlantBuilder(WorldSpec(), vehicle, default_starts(vehicle))
    flight = SteppedFlight(builder.build(Feedback.STATE, FRAME_US), autopilot, wire)
    states = []
    for _ in range(frames):
        wire.at(flight.time_us)
        states.append(flight.step().world.state)
    return states
