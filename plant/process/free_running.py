"""The plant as hardware would be: it follows the wall clock, and waits for no answer."""

from time import perf_counter

from colibri.common.process.lifecycle import Stop
from colibri.common.process.status import Progress, Status
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.process.logs import PlantLogs
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
        self._cut_after_s = cut_after_s

    def fly(self, plant: Plant, *, duration_s: float, speed: float) -> None:
        """Fly for `duration_s` at `speed` times real time, or until told to stop."""
        began_s = perf_counter()
        pace, progress = Pace(speed, began_s), Progress(self._status)
        silence = Silence(self._cut_after_s)
        frames = answers = 0
        waited_s = 0.0
        while not self._stop and plant.world.time_us + plant.interval_us <= duration_s * 1e6:
            begin_us = plant.world.time_us
            sent_s = self._tell(plant)
            due_s = pace.due_s(begin_us + plant.interval_us, sent_s)
            faults: list[Fault] = []
            while (command := self._hear(due_s)) is not None:
                since_us = round((perf_counter() - due_s) * 1e6 * speed) + plant.interval_us
                now_us = begin_us + max(0, min(since_us, plant.interval_us))
                waited_s += (now_us - command.time_us) * 1e-6
                plant.arrive(now_us, command)
                faults += self._end.take_faults()
                answers += 1
                if silence.ends(now_us):
                    self._status.say("answered", "the autopilot answers again")
            if silence.lasts(begin_us):
                plant.arrive(begin_us, ActuatorCommand(begin_us, _STANDING, armed=False))
                where = f"no command for {self._cut_after_s:g} s at t = {begin_us / 1e6:.3f} s"
                self._status.say("silence", f"{where}: the rotors are stopped, waiting for the autopilot")
            plant.inject(faults)
            plant.go_on()
            frames += 1
            progress.report(plant.world.time_us / 1e6, perf_counter() - began_s)
        self._log(plant.world)
        time_s = plant.world.time_us / 1e6
        self._status.say(
            "ended",
            f"ended at t = {time_s:.3f} s after {frames} frames, {answers} of them answered",
            sim_time_s=time_s,
            wall_time_s=perf_counter() - began_s,
            frames=frames,
            answers=answers,
            round_trip_ms=1e3 * waited_s / max(answers, 1),
            resent=0,
            dropped=dict(self._end.dropped),
        )

    def _tell(self, plant: Plant) -> float:
        """Send a frame; return when."""
        self._time_us = plant.world.time_us
        frame, plant_status = plant.tell()
        now_s = perf_counter()
        self._end.offer(frame, now_s, plant_status)
        self._send()
        self._log(plant.world)
        return now_s

    def _hear(self, until_s: float) -> ActuatorCommand | None:
        """Return the next command that comes until a wall-clock time, or has already come; None if none does."""
        while not self._stop:
            left_s = until_s - perf_counter()
            command = self._receive(max(0.0, left_s))
            if command is not None:
                return command
            if left_s <= 0.0:
                return None
        return None


class Silence:
    """Notices when commands cease, and when they come again; in simulated time."""

    def __init__(self, allowed_s: float) -> None:
        """Allow so long a silence from time 0 on."""
        self._allowed_us = allowed_s * 1e6
        self._heard_us = 0
        self._said = False

    def ends(self, now_us: int) -> bool:
        """Take in that a command has come; return whether that ends a silence that was too long."""
        said, self._said, self._heard_us = self._said, False, now_us
        return said

    def lasts(self, now_us: int) -> bool:
        """Return whether the silence has become too long just now."""
        if self._said or now_us - self._heard_us < self._allowed_us:
            return False
        self._said = True
        return True
