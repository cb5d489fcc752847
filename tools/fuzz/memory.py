"""A flight of the thesis's spiral within this process, through both ends of the conversation, with or without fire."""

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.step import answer
from colibri.autopilot.core.track_stages import track_autopilot
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.types import Address
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.start import DEFAULT_STARTS
from colibri.plant.physics.world import Physics, State, World, starting_world, state_frame
from colibri.plant.vehicle.description import load_vehicle
from tools.fuzz.datagrams import FRAME_US, Fuzzer

SYSTEM_ID = 1
NOW_S = 0.0
_ADDRESS: Address = ("memory", 0)


class Flight:
    """Plant, autopilot and the datagrams between them; the wall clock stands still.

    Attributes:
        plant_end: The plant's end.
        autopilot_end: The autopilot's end.
    """

    def __init__(self) -> None:
        """Let the autopilot call the plant."""
        profile = load_profile("thesis")
        vehicle = load_vehicle(profile.simulation.vehicle)
        self._autopilot = track_autopilot(profile, vehicle, track("spiral"), lambda: NOW_S)
        self._physics = Physics(vehicle, "rk4")
        self._world = starting_world(DEFAULT_STARTS[Feedback.STATE], vehicle)
        self.plant_end = PlantEnd(system_id=SYSTEM_ID, frame_interval_us=FRAME_US)
        self.autopilot_end = AutopilotEnd(system_id=SYSTEM_ID, frame_interval_us=FRAME_US, now_s=NOW_S)
        self.autopilot_end.poll(NOW_S)
        self._to_plant([])

    def fly(self, frames: int, burst: int = 0, fuzzers: tuple[Fuzzer, Fuzzer] | None = None) -> list[State]:
        """Fly so many frames; return the states.

        `burst` hostile datagrams are before, and as many after, each good one: by the first of `fuzzers` to the plant,
        by the second to the autopilot.
        """
        states = []
        for _ in range(frames):
            self._world = self._step(self._world, burst, fuzzers)
            states.append(self._world.state)
        return states

    def _step(self, world: World, burst: int, fuzzers: tuple[Fuzzer, Fuzzer] | None) -> World:
        self.plant_end.offer(state_frame(world), NOW_S)
        to_plant, to_autopilot = ([], []) if not fuzzers else (_bad(who, world.time_us, burst) for who in fuzzers)
        self._to_autopilot(to_autopilot)
        command = self._to_plant(to_plant)
        assert command is not None, "the answer names the frame awaited"
        return self._physics.step(world, command, FRAME_US)

    def _to_autopilot(self, bad: list[bytes]) -> None:
        good = [outgoing.datagram for outgoing in self.plant_end.take_outbox()]
        half = len(bad) // 2
        for datagram in (*bad[:half], *good, *bad[half:]):
            answer(self.autopilot_end, self._autopilot, datagram, NOW_S)

    def _to_plant(self, bad: list[bytes]) -> ActuatorCommand | None:
        good = self.autopilot_end.take_outbox()
        half = len(bad) // 2
        received = [self.plant_end.receive(it, _ADDRESS, NOW_S) for it in (*bad[:half], *good, *bad[half:])]
        self.plant_end.received.clear()
        commands = [command for command in received if command]
        assert len(commands) <= 1, "a frame is answered once"
        return commands[0] if commands else None


def _bad(fuzzer: Fuzzer, time_us: int, burst: int) -> list[bytes]:
    """Return a burst each side of a good datagram; none at the start of the flight."""
    fuzzer.moment_us = time_us
    return [fuzzer.hostile() for _ in range(2 * burst)] if time_us else []
