"""The plant as a server of ArduPilot, whose clock is the only one."""

from math import inf
from time import perf_counter
from typing import Any

from colibri.common.errors import Error
from colibri.common.process.lifecycle import Stop, fail
from colibri.common.process.status import Progress, Status
from colibri.common.types import Address
from colibri.mavlink.links.udp import UdpLink, is_bound
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.process.ardupilot import ArduPilotEnd
from colibri.plant.process.logs import PlantLogs
from colibri.plant.process.reports import MAX_WAIT_S, SILENT_AFTER_S, Silence, all_parameters_by, closing, report_end
from colibri.plant.process.start import nudged
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle
from colibri.plant.vehicle.parameter_files import ardupilot_thrust_curve


def run(spec: PlantSpec, link: UdpLink, status: Status, stop: Stop) -> int:
    try:
        weather = spec.weather
        vehicle = load_vehicle(spec.vehicle).without(spec.without)
        motors = vehicle.rotors.numbering()
        start = starting_world(nudged(spec.started(Start(psi=spec.home.yaw_enu_deg))), vehicle, weather)
    except Error as error:
        fail(str(error))
    frame_class, frame_type = motors.ardupilot_frame
    _, expo = ardupilot_thrust_curve(vehicle.rotors)
    text = f"{vehicle.name} is FRAME_CLASS {frame_class}, FRAME_TYPE {frame_type}, MOT_THST_EXPO {expo:.3g}"
    text = f"{text}; {all_parameters_by(str(spec.vehicle), 'ardupilot')}"
    status.say("frame", text, frame_class=frame_class, frame_type=frame_type, thrust_expo=expo)
    physics = Physics(vehicle, spec.integrator, weather, spec.disturbance)
    end = ArduPilotEnd(physics, start, motors, vehicle.rotors, is_bound)
    logs = PlantLogs(spec.out, vehicle) if spec.out else None
    with closing(link, logs):
        ArduPilotServer(end, link, status, stop, logs).serve(duration_s=spec.duration)
    return stop.code


REPEATED_AFTER_S = 0.5  # time since the last answer after which a request may have come twice: ArduPilot repeats it


class ArduPilotServer:
    """Serves one ArduPilot after another, each from the start."""

    def __init__(self, end: ArduPilotEnd, link: UdpLink, status: Status, stop: Stop, logs: PlantLogs | None) -> None:
        self._end, self._link, self._status, self._stop, self._logs = end, link, status, stop, logs
        self._silence = Silence(status, SILENT_AFTER_S, "ArduPilot asks again", perf_counter())
        self._answered_s = -inf
        self._begin(perf_counter())

    def _begin(self, now_s: float) -> None:
        self._began_s, self._steps, self._progress = now_s, 0, Progress(self._status)

    def serve(self, *, duration_s: float) -> None:
        while not self._stop and self._end.world.time_us < duration_s * 1e6:
            received = self._link.receive(MAX_WAIT_S)
            now_s = perf_counter()
            if received is not None:
                self._answer(received, now_s)
            elif self._end.peer:
                self._silence.lasts(now_s, "no request", self._end.world.time_us, ", waiting for ArduPilot")
        self._report(self._end.world.time_us, "ended", "ended")

    def _answer(self, received: tuple[bytes, Address], now_s: float) -> None:
        """Answer a request, once even if it was repeated while the plant was busy.

        ArduPilot would match a second reply to its next request, and fly one step late from then on.
        """
        late = now_s > self._answered_s + REPEATED_AFTER_S
        for datagram, sender in dict.fromkeys([received, *self._link.receive_now()]) if late else (received,):
            before, restarts, begins = self._end.world, self._end.restarts, self._end.peer is None
            reply = self._end.receive(datagram, sender, now_s)
            if reply is None:
                continue
            self._link.send(reply, sender)
            self._silence.end(now_s)
            if self._end.restarts > restarts:
                self._report(before.time_us, "gone", "ArduPilot has begun again, the flight before ended")
                if self._logs:
                    self._logs.begin_again()
                begins = True
            if begins:
                self._begin(now_s)
            self._answered_s = now_s
            if self._end.world is not before:
                self._steps += 1
                if self._logs:
                    self._logs.write_world(self._end.world)
            self._progress.report(self._end.world.time_us / 1e6, now_s - self._began_s)

    def _report(self, time_us: int, event: str, text: str) -> None:
        if self._logs:
            self._logs.flush()
        end, ended_s = self._end, max(self._began_s, self._answered_s)
        figures: dict[str, Any] = {"steps": self._steps, "restarts": end.restarts, "dropped": dict(end.dropped)}
        text = f"{text} {{}} after {self._steps} steps"
        report_end(self._status, time_us, self._began_s, text, event=event, ended_s=ended_s, **figures)
