"""The plant on a link: a lockstep server, driven by the wall clock."""

from time import perf_counter, sleep

from colibri.common.process.lifecycle import Stop
from colibri.common.process.status import Progress, Status
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.physics.world import World, state_frame
from colibri.plant.process.logs import PlantLogs
from colibri.plant.simulation.plant import Plant

_SILENCE_SAID_AFTER_S = 2.0
_MAX_WAIT_S = 0.1
_CATCH_UP_S = 0.1


class Pace:
    """When each frame is due by the wall clock.

    A flight that was held up for longer than a moment stays late: it does not hurry past those who fly it.
    """

    def __init__(self, speed: float, now_s: float) -> None:
        """Begin now, at `speed` times real time; infinite for flat out."""
        self._speed = speed
        self._began_s = now_s

    def due_s(self, time_us: int, now_s: float) -> float:
        """Return the wall-clock time at which simulated time `time_us` is due."""
        due_s = self._began_s + time_us / 1e6 / self._speed
        held_up_s = max(0.0, now_s - due_s - _CATCH_UP_S)
        self._began_s += held_up_s
        return due_s + held_up_s


class Server:
    """Drives the plant's end of the conversation over a link."""

    def __init__(
        self,
        link: UdpLink,
        end: PlantEnd,
        status: Status,
        stop: Stop,
        logs: PlantLogs | None,
        *,
        streams_truth: bool = False,
    ) -> None:
        """Serve `end` on `link` until `stop`; where it `streams_truth`, each frame has the true state behind it."""
        self._link = link
        self._end = end
        self._status = status
        self._stop = stop
        self._logs = logs
        self._streams_truth = streams_truth
        self._time_us = 0
        self._logged: World | None = None

    def wait(self) -> bool:
        """Wait for an autopilot; return False if told to stop first."""
        while not self._stop and self._end.peer is None:
            self._receive(_MAX_WAIT_S)
        return self._end.peer is not None

    def fly(self, plant: Plant, *, duration_s: float, speed: float) -> None:
        """Fly for `duration_s` at `speed` times real time, or until told to stop."""
        began_s = perf_counter()
        pace = Pace(speed, began_s)
        progress = Progress(self._status)
        frames = 0
        while not self._stop and plant.world.time_us + plant.interval_us <= duration_s * 1e6:
            self._wait_until(pace.due_s(plant.world.time_us, perf_counter()))
            command = self._exchange(plant)
            if command is None:
                break
            plant.answer(command, self._end.take_faults())
            frames += 1
            progress.report(plant.world.time_us / 1e6, perf_counter() - began_s)
        self._log(plant.world)
        time_s = plant.world.time_us / 1e6
        self._status.say(
            "ended",
            f"ended at t = {time_s:.3f} s after {frames} frames",
            sim_time_s=time_s,
            wall_time_s=perf_counter() - began_s,
            frames=frames,
            resent=self._end.resent,
            dropped=dict(self._end.dropped),
        )

    def _exchange(self, plant: Plant) -> ActuatorCommand | None:
        """Send a frame until its answer comes; None if the process is told to stop first."""
        world = plant.world
        self._time_us = world.time_us
        offered_s = perf_counter()
        frame, plant_status = plant.tell()
        self._end.offer(frame, offered_s, plant_status, state_frame(world) if self._streams_truth else None)
        self._send()
        self._log(world)  # while the autopilot computes
        silence_said = False
        due_s = offered_s
        while not self._stop:
            command = self._receive(min(max(0.0, due_s - perf_counter()), _MAX_WAIT_S))
            if command is not None:
                if silence_said:
                    self._status.say("answered", "the autopilot answers again")
                return command
            now_s = perf_counter()
            due_s = self._end.poll(now_s)
            self._send()
            if not silence_said and now_s - offered_s > _SILENCE_SAID_AFTER_S:
                silence_said = True
                self._status.say("silence", f"no answer at t = {world.time_us / 1e6:.3f} s, waiting for the autopilot")
        return None

    def _log(self, world: World) -> None:
        if self._logs and world is not self._logged:
            self._logs.write_world(world)
        self._logged = world

    def _receive(self, timeout_s: float) -> ActuatorCommand | None:
        received = self._link.receive(timeout_s)
        if received is None:
            return None
        command = self._end.receive(*received, perf_counter())
        self._send()
        return command

    def _send(self) -> None:
        sent = self._end.take_outbox()
        for outgoing in sent:
            self._link.send(outgoing.datagram, outgoing.address)
        if self._logs:
            self._logs.write_traffic(self._time_us, self._end.received, sent)
        self._end.received.clear()

    def _wait_until(self, due_s: float) -> None:
        while not self._stop and (early_s := due_s - perf_counter()) > 0.0:
            sleep(min(early_s, _MAX_WAIT_S))
