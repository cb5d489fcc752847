"""The plant as a process: a lockstep server on a link, driven by the wall clock, with its logs."""

import argparse
from pathlib import Path
from time import perf_counter, sleep

from mavlink.feedback import Feedback
from mavlink.hil import ActuatorCommand
from mavlink.link import LinkError, UdpLink
from mavlink.lockstep import Outgoing, PlantEnd
from mavlink.process import EXIT_FAILED, EXIT_INTERRUPTED, CsvLog, Progress, Status, Stop, TlogWriter, fail, undisturbed
from plant.core import Plant
from plant.dynamics import STATE
from plant.scenario import IntegrationError, Start, nudged
from plant.sensors import served_by
from plant.vehicle import VehicleError, load_vehicle
from plant.weather import weather_of
from plant.world import Physics, World, starting_world, state_frame

WIND_COLUMNS = ("wind_east", "wind_north", "wind_up")
TRUTH_COLUMNS = ("t", *STATE, "omega1", "omega2", "omega3", "omega4", "voltage_v", "charge_ah", *WIND_COLUMNS)

DEFAULT_STARTS = {
    Feedback.STATE: Start(y=-1.0, z=2.0, psi=90.0, rotors=4740.0),
    Feedback.SENSORS: Start(y=-1.0, psi=90.0),
}
"""The thesis's spiral; or below it on the ground, where an estimator finds its bearings."""

_SILENCE_SAID_AFTER_S = 2.0
_WAIT_AT_MOST_S = 0.1
_CATCH_UP_S = 0.1


def run(args: argparse.Namespace, link: UdpLink, status: Status, stop: Stop) -> int:
    """Serve one flight on `link` as the command line says; return the exit code."""
    try:
        weather = weather_of(args)
        vehicle = load_vehicle(args.vehicle).without(args.without)
        serves = served_by(vehicle)
        worlds = {
            it: starting_world(nudged(DEFAULT_STARTS[it]._replace(**args.start)), vehicle, weather) for it in serves
        }
    except VehicleError as error:
        fail(str(error))
    physics = Physics(vehicle, args.integrator, weather)
    if args.truth:  # several flights share the cores: whoever waits gives way at once
        link.spin_s = 0.0
    logs = PlantLogs(args.out) if args.out else None
    interval_us = round(1e3 / args.rate) * 1000
    end = PlantEnd(system_id=args.system_id, frame_interval_us=interval_us, serves=serves, waits=not args.realtime)
    server = Server(link, end, status, stop, logs, tells_truth=args.truth)
    if args.realtime:
        from plant.free_process import FreeServer

        server = FreeServer(link, end, status, stop, logs, cut_after_s=args.cut_after)
    try:
        with undisturbed():
            if server.wait():
                plant = Plant(
                    worlds[end.feedback],
                    vehicle,
                    physics,
                    end.feedback,
                    args.home.origin,
                    seed=args.seed,
                    interval_us=end.frame_interval_us,
                    latency_us=round(args.latency * 1e3),
                )
                server.fly(plant, duration_s=args.duration, speed=args.speed)
    except (IntegrationError, LinkError) as error:
        fail(str(error), EXIT_FAILED)
    finally:
        link.close()
        if logs:
            logs.close()
    return EXIT_INTERRUPTED if stop else 0


def truth_row(world: World) -> tuple[float, ...]:
    """Return what `TRUTH_COLUMNS` names; `nan` volts where there is no battery."""
    battery = (world.voltage_v, world.charge_used_ah)
    return (world.time_us / 1e6, *world.state, *world.rotor_speeds, *battery, *world.wind_enu_m_s)


class PlantLogs:
    """What the plant writes: the truth at every frame, and every MAVLink frame."""

    def __init__(self, folder: Path) -> None:
        """Create `plant.csv` and `flight.tlog` in `folder`."""
        self._truth = CsvLog(folder / "plant.csv", TRUTH_COLUMNS)
        self._tlog = TlogWriter(folder / "flight.tlog")

    def write_world(self, world: World) -> None:
        """Append the truth."""
        self._truth.write(truth_row(world))

    def write_traffic(self, time_us: int, received: list[bytes], sent: list[Outgoing]) -> None:
        """Append what was received and sent at simulated time `time_us`."""
        self.write_frames(time_us, [*received, *(frame for outgoing in sent for frame in outgoing.frames)])

    def write_frames(self, time_us: int, frames: list[bytes]) -> None:
        """Append frames of simulated time `time_us`."""
        if frames:
            self._tlog.write(time_us, frames)

    def close(self) -> None:
        """Close both."""
        self._truth.close()
        self._tlog.close()


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
        tells_truth: bool = False,
    ) -> None:
        """Serve `end` on `link` until `stop`; where it `tells_truth`, each frame has the true state behind it."""
        self._link = link
        self._end = end
        self._status = status
        self._stop = stop
        self._logs = logs
        self._tells_truth = tells_truth
        self._time_us = 0
        self._logged: World | None = None

    def wait(self) -> bool:
        """Wait for an autopilot; return False if told to stop first."""
        while not self._stop and self._end.peer is None:
            self._receive(_WAIT_AT_MOST_S)
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
        frame, aside = plant.tell()
        self._end.offer(frame, offered_s, aside, state_frame(world) if self._tells_truth else None)
        self._send()
        self._log(world)  # while the autopilot computes
        silence_said = False
        due_s = offered_s
        while not self._stop:
            command = self._receive(min(max(0.0, due_s - perf_counter()), _WAIT_AT_MOST_S))
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
            sleep(min(early_s, _WAIT_AT_MOST_S))
