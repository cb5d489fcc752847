"""The plant on a link, in lockstep or at the pace of the wall clock, like hardware."""

from collections.abc import Callable, Iterable
from math import inf, isfinite
from time import perf_counter, sleep
from typing import Any, TypeVarTuple

from colibri.common.errors import Error
from colibri.common.process.lifecycle import Stop, fail
from colibri.common.process.log_files import LogError
from colibri.common.process.status import Progress, Status
from colibri.common.types import Array
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_plant import PlantDatagram, PlantEnd
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.hil.world_changes import PaceChange, WorldChange
from colibri.mavlink.links.udp import UdpLink, is_bound
from colibri.plant.events import check_events
from colibri.plant.physics.start import default_starts, nudged
from colibri.plant.physics.world import state_frame
from colibri.plant.process.reports import MAX_WAIT_S, SILENT_AFTER_S, PlantLogs, Silence, closing, report_end
from colibri.plant.sensors.suite import served_by
from colibri.plant.simulation.plant import Plant, PlantBuilder
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle

Ts = TypeVarTuple("Ts")
_CATCH_UP_S = 0.1


class FramePacer:
    """Wall-clock deadlines of frames; a flight that was held up stays late instead of hurrying."""

    def __init__(self, speed: float, now_s: float) -> None:
        self.speed = speed
        self._began_s = now_s

    def change(self, asked: Iterable[Fault | WorldChange], time_us: int, now_s: float) -> None:
        """Adopt the last requested pace."""
        for change in asked:
            if isinstance(change, PaceChange) and isfinite(self.speed):
                self.speed = change.speed
                self._began_s = now_s - time_us / 1e6 / self.speed

    def due_s(self, time_us: int, now_s: float) -> float:
        due_s = self._began_s + time_us / 1e6 / self.speed
        held_up_s = max(0.0, now_s - due_s - _CATCH_UP_S)
        self._began_s += held_up_s
        return due_s + held_up_s


class Server:
    """The plant's end of the lockstep; with `streams_truth`, the true state follows each frame of sensors."""

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
        self._link, self._end, self._status, self._stop, self._logs = link, end, status, stop, logs
        self._streams_truth = streams_truth
        self._time_us, self._end_us = 0, inf
        self._unlogged: list[tuple[Array, int]] = []  # rows of the truth, and the last one's time, µs
        self._ends = True
        self._progress, self._began_s = Progress(status), 0.0
        self._silence = Silence(status, SILENT_AFTER_S, "the autopilot answers again", 0.0)

    def wait(self) -> bool:
        while not self._stop and self._end.peer is None:
            self._receive(MAX_WAIT_S)
        return self._end.peer is not None

    def fly(self, plant: Plant, *, duration_s: float, speed: float) -> None:
        self._ends = isfinite(duration_s)
        self._began_s = began_s = perf_counter()
        pace, frames, self._end_us = FramePacer(speed, began_s), 0, duration_s * 1e6
        self._keep(PlantLogs.write_world, plant.world)
        while not self._stop and plant.world.time_us + plant.interval_us <= self._end_us:
            if not self._advance(plant, pace):
                break
            frames += len(plant.flown)
            self._unlogged.append((plant.flown, plant.world.time_us))
        self._log_traffic([])
        self._log_truth()
        self._keep(PlantLogs.flush)
        figures: dict[str, Any] = {"frames": frames, "resent": self._end.resent, "dropped": dict(self._end.dropped)}
        text, own = self._own_figures()
        report_end(
            self._status, plant.world.time_us, began_s, f"ended {{}} after {frames} frames{text}", **(figures | own)
        )

    def _own_figures(self) -> tuple[str, dict[str, float]]:
        return "", {}

    def _advance(self, plant: Plant, pace: FramePacer) -> bool:
        if isfinite(pace.speed):
            self._wait_until(pace.due_s(plant.world.time_us, perf_counter()))
        command = self._ahead(plant) or self._exchange(plant)
        if command is None:
            return False
        asked = self._end.take_faults()
        if asked:
            pace.change(asked, plant.world.time_us, perf_counter())
        plant.answer(command, asked, min(self._end.next_us(plant.world.time_us), self._end_us))
        self._end.skip(len(plant.flown) - 1)
        return True

    def _ahead(self, plant: Plant) -> ActuatorCommand | None:
        """Return the command of a frame that was answered ahead; the frame is sent if it holds more than a state."""
        time_us = plant.world.time_us
        command = self._end.ahead(time_us)
        if command is None:
            return None
        if self._end.feedback is Feedback.SENSORS or plant.has_news or self._end.sends_battery(time_us):
            self._offer(plant)
        else:
            self._end.skip()
        return command

    def _offer(self, plant: Plant) -> float:
        world = plant.world
        frame, plant_status = plant.measure(with_battery=self._end.sends_battery(world.time_us))
        now_s = perf_counter()
        truth = state_frame(world) if self._streams_truth and isinstance(frame, SensorFrame) else None
        self._end.offer(frame, now_s, plant_status, truth)
        sent = self._send()
        self._log_traffic([])  # while the autopilot computes
        self._time_us = world.time_us
        self._log_traffic(sent)
        self._log_truth()
        self._progress.report(world.time_us / 1e6, now_s - self._began_s)
        plant.foresee()
        return now_s

    def _exchange(self, plant: Plant) -> ActuatorCommand | None:
        """Send a frame until its answer comes; None if a signal comes first."""
        due_s = self._offer(plant)
        self._silence.end(due_s)
        while not self._stop:
            command = self._receive(min(max(0.0, due_s - perf_counter()), MAX_WAIT_S))
            if command is not None:
                return command
            now_s = perf_counter()
            due_s = self._end.poll(now_s)
            self._send_and_log()
            self._silence.lasts(now_s, "no answer", plant.world.time_us, ", waiting for the autopilot")
        return None

    def _log_truth(self) -> None:
        unlogged, self._unlogged = self._unlogged, []
        for rows, until_us in unlogged:
            self._keep(PlantLogs.write_truth, rows, until_us)

    def _keep(self, write: Callable[[PlantLogs, *Ts], None], *args: *Ts) -> None:
        """Write to the logs; an endless flight goes on without a log that cannot be written."""
        if self._logs is None:
            return
        try:
            write(self._logs, *args)
        except LogError as error:
            if self._ends:
                raise
            self._status.say("said", f"{error}; flying on")

    def _receive(self, timeout_s: float) -> ActuatorCommand | None:
        end, link = self._end, self._link
        received = link.receive(timeout_s)
        if received is None:
            if link.kept is not None and end.accepts_another(perf_counter()):
                link.release()
            return None
        command = end.receive(*received, perf_counter())
        if command is None or link.kept is None:
            if link.kept is None and received[1] == end.peer:
                link.keep_to(received[1])
            if end.notes:
                self._status.say("said", end.notes.pop())
            self._send_and_log()
        return command

    def _send(self) -> list[PlantDatagram]:
        sent = self._end.take_outbox()
        for outgoing in sent:
            self._link.send(outgoing.datagram, outgoing.address)
        return sent

    def _send_and_log(self) -> None:
        sent = self._send()
        if sent:
            self._log_traffic(sent)

    def _log_traffic(self, sent: list[PlantDatagram]) -> None:
        received, time_us = self._end.received, self._time_us
        if self._logs is not None and self._logs.has_tlog:
            frames = [*received, *(frame for outgoing in sent for frame in outgoing.frames)]
            self._keep(PlantLogs.write_frames, time_us, frames)
        received.clear()

    def _wait_until(self, due_s: float) -> None:
        while not self._stop and (early_s := due_s - perf_counter()) > 0.0:
            sleep(min(early_s, MAX_WAIT_S))


class FreeServer(Server):
    """Sends each frame when it is due; the rotors follow the newest command, or stop after `cut_after_s` without."""

    def __init__(
        self, link: UdpLink, end: PlantEnd, status: Status, stop: Stop, logs: PlantLogs | None, *, cut_after_s: float
    ) -> None:
        super().__init__(link, end, status, stop, logs)
        self._missing = f"no command for {cut_after_s:g} s"
        self._silence = Silence(status, cut_after_s, "the autopilot answers again", 0.0)
        self._answers = 0
        self._round_trips_s = 0.0

    def _own_figures(self) -> tuple[str, dict[str, float]]:
        round_trip_ms = 1e3 * self._round_trips_s / max(self._answers, 1)
        figures = {"answers": self._answers, "round_trip_ms": round_trip_ms}
        return f", {self._answers} of them answered", figures

    def _advance(self, plant: Plant, pace: FramePacer) -> bool:
        begin_us = plant.world.time_us
        due_s = pace.due_s(begin_us + plant.interval_us, self._offer(plant))
        faults: list[Fault | WorldChange] = []
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
            plant.arrive(begin_us, ActuatorCommand(begin_us, (0.0,) * len(plant.world.rotor_speeds), armed=False))
        if faults:
            pace.change(faults, begin_us, due_s)
        plant.inject(faults)
        plant.go_on()
        return True

    def _next_command(self, until_s: float) -> ActuatorCommand | None:
        while not self._stop:
            left_s = until_s - perf_counter()
            command = self._receive(max(0.0, left_s))
            if command is not None or left_s <= 0.0:
                return command
        return None


def builder_of(spec: PlantSpec) -> PlantBuilder:
    vehicle = load_vehicle(spec.vehicle).without(spec.without)
    check_events(spec.events, vehicle, on_sensors=vehicle.sensors is not None)
    usual = default_starts(vehicle)
    starts = {it: nudged(spec.started(usual[it])) for it in served_by(vehicle)}
    return PlantBuilder(spec, vehicle, starts, integrator=spec.integrator, origin=spec.home.origin)


def run(spec: PlantSpec, link: UdpLink, status: Status, stop: Stop) -> int:
    try:
        builder = builder_of(spec)
    except Error as error:
        fail(str(error))
    if spec.truth:  # several flights share the cores: whoever waits gives way at once
        link.spin_s = 0.0
    logs = PlantLogs(spec.out, builder.vehicle, spec.boot_unix_us, tlog=spec.tlog) if spec.out else None
    interval_us = round(1e3 / spec.rate) * 1000
    end = PlantEnd(
        system_id=spec.system_id,
        frame_interval_us=interval_us,
        serves=tuple(builder.starts),
        waits=not spec.realtime,
        takes_ahead=not (spec.tlog or spec.truth),
        rotors=builder.vehicle.rotors.count,
        is_there=is_bound,
    )
    server = Server(link, end, status, stop, logs, streams_truth=spec.truth)
    if spec.realtime:
        server = FreeServer(link, end, status, stop, logs, cut_after_s=spec.cut_after)
    with closing(link, logs, out=spec.out):
        if server.wait():
            plant = builder.build(end.feedback, end.frame_interval_us)
            server.fly(plant, duration_s=spec.duration, speed=spec.pace)
    return stop.code
