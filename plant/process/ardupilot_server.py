"""The plant as a server of ArduPilot: it answers on a link, and ArduPilot's clock is the only one."""

import argparse
from time import perf_counter
from typing import Any

from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_INTERRUPTED, Stop, fail
from colibri.common.process.status import Progress, Status
from colibri.common.types import Address
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.environment.weather import weather_of
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.process.ardupilot import ArduPilotEnd
from colibri.plant.process.logs import PlantLogs
from colibri.plant.process.options import nudged
from colibri.plant.process.reports import MAX_WAIT_S, SILENT_AFTER_S, Silence, closing, report_end
from colibri.plant.vehicle.description import load_vehicle


def run(args: argparse.Namespace, link: UdpLink, status: Status, stop: Stop) -> int:
    """Serve ArduPilot on `link` as the command line asks; return the exit code."""
    try:
        weather = weather_of(args)
        vehicle = load_vehicle(args.vehicle).without(args.without)
        motors = vehicle.rotors.numbering()
        start = starting_world(nudged(Start(psi=args.home.yaw_enu_deg)._replace(**args.start)), vehicle, weather)
    except Error as error:
        fail(str(error))
    frame_type = motors.ardupilot_frame_type
    expo = 1 if vehicle.rotors.control == "speed" else 0
    text = f"{vehicle.name} is FRAME_CLASS 1, FRAME_TYPE {frame_type}, MOT_THST_EXPO {expo}"
    status.say("frame", text, frame_class=1, frame_type=frame_type, thrust_expo=expo)
    end = ArduPilotEnd(Physics(vehicle, args.integrator, weather), start, motors, vehicle.rotors)
    logs = PlantLogs(args.out, speaks_mavlink=False) if args.out else None
    with closing(link, logs):
        ArduPilotServer(end, link, status, stop, logs).serve(duration_s=args.duration)
    return EXIT_INTERRUPTED if stop else 0


class ArduPilotServer:
    """Answers one ArduPilot after the other, each from the start."""

    def __init__(self, end: ArduPilotEnd, link: UdpLink, status: Status, stop: Stop, logs: PlantLogs | None) -> None:
        """Answer on `link` by `end` until `stop`."""
        self._end, self._link, self._status, self._stop, self._logs = end, link, status, stop, logs
        self._silence = Silence(status, SILENT_AFTER_S, "ArduPilot asks again", perf_counter())
        self._begin(perf_counter())

    def serve(self, *, duration_s: float) -> None:
        """Answer until a flight is `duration_s` long, or a signal ends it.

        Raises:
            IntegrationError: The state cannot be integrated any further.
            LogError: A log cannot be written.
        """
        while not self._stop and self._end.world.time_us < duration_s * 1e6:
            received = self._link.receive(MAX_WAIT_S)
            now_s = perf_counter()
            if received is not None:
                self._answer(received, now_s)
            elif self._end.peer:
                self._silence.lasts(now_s, "no request", self._end.world.time_us, ", waiting for ArduPilot")
        self._report(self._end.world.time_us, "ended", "ended")

    def _answer(self, received: tuple[bytes, Address], now_s: float) -> None:
        """Answer what has come.

        A request that has come again before it was answered, for instance while the plant was loading, is answered
        once: ArduPilot would take the second reply for that to its next request, and so fly a step late for good.
        """
        for datagram, sender in dict.fromkeys([received, *self._link.receive_now()]):
            flown, restarts, began = self._end.world, self._end.restarts, self._end.peer is not None
            reply = self._end.receive(datagram, sender, now_s)
            if reply is None:
                continue
            self._link.send(reply, sender)
            self._silence.end(now_s)
            if self._end.restarts > restarts:
                self._report(flown.time_us, "gone", "ArduPilot has begun again")
                if self._logs:
                    self._logs.begin_again()
            if self._end.restarts > restarts or not began:
                self._begin(now_s)
            if self._logs and self._end.world is not flown:
                self._logs.write_world(self._end.world)
            self._steps += self._end.world is not flown
            self._answered_s = now_s
            self._progress.report(self._end.world.time_us / 1e6, now_s - self._began_s)

    def _begin(self, now_s: float) -> None:
        """Count steps and the wall clock's time of a flight from now on."""
        self._began_s = self._answered_s = now_s
        self._steps = 0
        self._progress = Progress(self._status)

    def _report(self, time_us: int, event: str, text: str) -> None:
        """Report the end of a flight, whose last answer was its end."""
        if self._logs:
            self._logs.flush()
        steps = self._steps
        figures: dict[str, Any] = {"steps": steps, "restarts": self._end.restarts, "dropped": dict(self._end.dropped)}
        text = f"{text} {{}} after {steps} steps"
        report_end(self._status, time_us, self._began_s, text, event=event, ended_s=self._answered_s, **figures)
