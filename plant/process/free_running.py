"""The plant as hardware would be: it follows the wall clock, and waits for no answer."""

from time import perf_counter

from colibri.common.process.lifecycle import Stop
from colibri.common.process.status import Status
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.process.logs import PlantLogs
from colibri.plant.process.reports import Silence
from colibri.plant.process.server import Pace, Server
from colibri.plant.simulation.plant import Plant

_STANDING = (0.0, 0.0, 0.0, 0.0)


class FreeServer(Server):
    """Sends each frame when it is due; the rotors follow the newest command from the moment at which it came."""

    def __init__(
        self,
        link: UdpLink,
        end: PlantEnd,
        status: Status,
        stop: Stop,
        logs: PlantLogs | None,
        *,
        cut_after_s: float,
    ) -> None:
        """Serve `end` on `link` until `stop`; stop the rotors where no command comes for `cut_after_s`, simulated."""
        super().__init__(link, end, status, stop, logs)
        self._missing = f"no command for {cut_after_s:g} s"
        self._silence = Silence(status, cut_after_s, "the autopilot answers again", 0.0)
        self._answers = 0
        self._round_trips_s = 0.0

    def _own_figures(self) -> tuple[str, dict[str, float]]:
        round_trip_ms = 1e3 * self._round_trips_s / max(self._answers, 1)
        figures = {"answers": self._answers, "round_trip_ms": round_trip_ms}
        return f", {self._answers} of them answered", figures

    def _advance(self, plant: Plant, pace: Pace) -> bool:
        """Send a frame, and go on with the commands that come until the next one is due."""
        begin_us = plant.world.time_us
        due_s = pace.due_s(begin_us + plant.interval_us, self._offer(plant))
        faults: list[Fault] = []
        while (command := self._next_command(due_s)) is not None:
            since_us = round((perf_counter() - due_s) * 1e6 * pace.speed) + plant.interval_us
            now_us = begin_us + max(0, min(since_us, plant.interval_us))
            self._round_trips_s += (now_us - command.time_us) * 1e-6
            plant.arrive(now_us, command)
            faults += self._end.take_faults()
            self._answers += 1
            self._silence.end(now_us * 1e-6)
        waiting = ": the rotors are stopped, waiting for the autopilot"
        if self._silence.lasts(begin_us * 1e-6, self._missing, begin_us, waiting):
            plant.arrive(begin_us, ActuatorCommand(begin_us, _STANDING, armed=False))
        plant.inject(faults)
        plant.go_on()
        return True

    def _next_command(self, until_s: float) -> ActuatorCommand | None:
        """Return the next command received before a wall-clock time; None if there is none."""
        while not self._stop:
            left_s = until_s - perf_counter()
            command = self._receive(max(0.0, left_s))
            if command is not None:
                return command
            if left_s <= 0.0:
                return None
        return None
