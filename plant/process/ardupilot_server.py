"""The plant as a server of ArduPilot, whose clock is the only one."""

from collections import Counter
from collections.abc import Callable
from math import inf
from struct import Struct
from time import perf_counter
from typing import Any

import msgspec

from colibri.common.errors import Error
from colibri.common.process.lifecycle import Stop, fail
from colibri.common.process.status import Progress, Status
from colibri.common.types import Address, Array
from colibri.mavlink.hil.lockstep import is_another
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.links.udp import UdpLink, is_bound
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu
from colibri.plant.physics.start import Start, nudged
from colibri.plant.physics.world import Physics, World, starting_world, state_frame
from colibri.plant.process.reports import (
    MAX_WAIT_S,
    SILENT_AFTER_S,
    PlantLogs,
    Silence,
    all_parameters_by,
    closing,
    report_end,
)
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import Rotors, load_vehicle
from colibri.plant.vehicle.parameter_files import ardupilot_thrust_curve
from colibri.plant.vehicle.rotor_numbering import Numbering

_MAGIC = {Struct("<HHI16H"): 18458, Struct("<HHI32H"): 29569}
_FORMATS = {form.size: form for form in _MAGIC}
_FIRST_ROTOR = 3
_MIN_PULSE_US, _MAX_PULSE_US, _PULSE_RANGE_US = 1000, 2000, 1000.0
_SECOND_US = 1_000_000
_MIN_RATE_HZ = 10


class ArduPilotEnd:
    """Steps a world at each request; `is_there` tells whether a program has the address of a silent peer."""

    def __init__(
        self,
        physics: Physics,
        start: World,
        motors: Numbering,
        rotors: Rotors,
        is_there: Callable[[Address], bool] = lambda _: False,
    ) -> None:
        self._physics, self._is_there = physics, is_there
        self._rotor_fields = [_FIRST_ROTOR + motors.rotors.index(rotor) for rotor in range(rotors.count)]
        self._speed_of_pulse = _speed_of_pulse(rotors)
        self._start = self.world = start
        self.peer: Address | None = None
        self.steps = self.restarts = 0
        self.dropped: Counter[str] = Counter()
        self._received_s = 0.0
        self._count: int | None = None
        self._carried = 0
        self._reply = b""

    def receive(self, datagram: bytes, sender: Address, now_s: float) -> bytes | None:
        form = _FORMATS.get(len(datagram))
        fields = form.unpack(datagram) if form else ()
        if form is None or fields[0] != _MAGIC[form]:
            self.dropped["malformed"] += 1
            return None
        _, rate_hz, count = fields[:3]
        if rate_hz < _MIN_RATE_HZ:
            self.dropped["frame rate"] += 1
            return None
        if not self.accepts_another(now_s, sender):
            self.dropped["second autopilot"] += 1
            return None
        self.peer, self._received_s = sender, now_s
        if count == self._count:
            self.dropped["repeated"] += 1
            return self._reply
        if self._count is not None and count < self._count:
            self.world, self._carried = self._start, 0
            self.restarts += 1
        self._count = count
        self._advance(rate_hz, fields)
        self._reply = _encode(self.world, self._physics)
        return self._reply

    @property
    def flown(self) -> Array:
        """Return the truth after the last step, a row of `physics.frames`."""
        return self._physics.rows

    def accepts_another(self, now_s: float, sender: Address | None = None) -> bool:
        """Whether the peer is lost, so that another ArduPilot may take over, or is the sender."""
        return not is_another(sender, self.peer, now_s - self._received_s, self._is_there)

    def _advance(self, rate_hz: int, fields: tuple[int, ...]) -> None:
        duration_us, self._carried = divmod(_SECOND_US + self._carried, rate_hz)
        speeds = tuple([self._speed_of_pulse[min(fields[at], _MAX_PULSE_US)] for at in self._rotor_fields])
        turning = any(speeds)  # disarmed, ArduPilot sends the least pulse or none
        command = ActuatorCommand(self.world.time_us, speeds, turning)
        self.world = self._physics.step(self.world, command, duration_us)
        self.steps += 1


def _speed_of_pulse(rotors: Rotors) -> tuple[float, ...]:
    """Return the rotor speed, in parts of the largest, of each pulse from 0 µs on."""
    return rotors.speeds_of(tuple([max(us - _MIN_PULSE_US, 0) / _PULSE_RANGE_US for us in range(_MAX_PULSE_US + 1)]))


def _encode(world: World, physics: Physics) -> bytes:
    frame = state_frame(world)
    values = {
        "timestamp": world.time_us / _SECOND_US,
        "imu": {"gyro": frd_from_flu(frame.rate_flu_rad_s), "accel_body": frd_from_flu(physics.specific_force(world))},
        "position": ned_from_enu(frame.position_enu_m),
        "quaternion": ned_frd_from_enu_flu(frame.attitude),
        "velocity": ned_from_enu(frame.velocity_enu_m_s),
    }
    return b"\n" + msgspec.json.encode(values) + b"\n"


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
                if self._link.kept is not None and self._end.accepts_another(now_s):
                    self._link.release()
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
            if self._link.kept is None:
                self._link.keep_to(sender)
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
                    self._logs.write_truth(self._end.flown, self._end.world.time_us)
            self._progress.report(self._end.world.time_us / 1e6, now_s - self._began_s)

    def _report(self, time_us: int, event: str, text: str) -> None:
        if self._logs:
            self._logs.flush()
        end, ended_s = self._end, max(self._began_s, self._answered_s)
        figures: dict[str, Any] = {"steps": self._steps, "restarts": end.restarts, "dropped": dict(end.dropped)}
        text = f"{text} {{}} after {self._steps} steps"
        report_end(self._status, time_us, self._began_s, text, event=event, ended_s=ended_s, **figures)
