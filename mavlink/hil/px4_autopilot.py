"""PX4's simulator interface, the autopilot's end, as a state machine without I/O.

It sends a HEARTBEAT twice a second. Each HIL_SENSOR is answered by a HIL_ACTUATOR_CONTROLS of the same time that
requests lockstep. Time counts from the first frame.

Quirks of jMAVSim: its HIL_GPS belongs to the next HIL_SENSOR; an empty `fields_updated` of old versions counts as all
new.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from colibri.common.types import PerRotor
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.lockstep import AnsweringEnd
from colibri.mavlink.hil.plant_status import ReceivedFrame
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame, Updated, decode_gps, decode_sensors
from colibri.mavlink.hil.state import ActuatorCommand, encode_actuators
from colibri.mavlink.hil.world_changes import WorldChange

CALL_EVERY_S = 0.5  # wall-clock interval of HEARTBEAT
ANSWER_AGAIN_AFTER_S = 1.0  # wall-clock silence before the last answer is repeated

_EVERYTHING = Updated.ACCELEROMETER | Updated.GYROSCOPE | Updated.MAGNETOMETER | Updated.BAROMETER


class FlierEnd(AnsweringEnd):
    def __init__(self, *, system_id: int, now_s: float, to_motors: Callable[[PerRotor], PerRotor]) -> None:
        super().__init__(system_id, now_s - ANSWER_AGAIN_AFTER_S, now_s)
        self._to_motors = to_motors
        self._zero_us: int | None = None
        self._fix: GpsFix | None = None
        self._armed = False
        self._again_at_s = now_s

    def receive(self, datagram: bytes, now_s: float) -> ReceivedFrame | None:
        frame = None
        for message in self._codec.decode(datagram):
            if message.name == "HIL_SENSOR":
                frame = self._next(decode_sensors(message), now_s) or frame
            elif message.name == "HIL_GPS":
                self._fix = decode_gps(message)
            elif message.name not in ("HEARTBEAT", "HIL_STATE_QUATERNION", "SYSTEM_TIME", "COMMAND_ACK"):
                self.dropped["unexpected"] += 1
        return None if frame is None else ReceivedFrame(frame)

    def answer(self, command: ActuatorCommand, faults: Sequence[Fault | WorldChange] = ()) -> None:
        assert not faults, "whoever flies a simulator refuses them"
        assert self._zero_us is not None, "what is answered has come"
        self._armed = command.armed
        controls = self._to_motors(command.controls)
        moved = command._replace(time_us=command.time_us + self._zero_us, controls=controls)
        self._answer = encode_actuators(self._codec, moved)
        self._outbox.append(self._answer)

    def poll(self, now_s: float) -> float:
        if now_s >= self._call_at_s:
            self._call_at_s = now_s + CALL_EVERY_S
            self._outbox.append(self._heartbeat(self._armed))
        if self._answer is None:
            return self._call_at_s
        if now_s >= self._again_at_s:
            self._again_at_s = now_s + ANSWER_AGAIN_AFTER_S
            self._outbox.append(self._answer)
        return min(self._call_at_s, self._again_at_s)

    def _next(self, frame: SensorFrame, now_s: float) -> SensorFrame | None:
        self._received_s, self._again_at_s = now_s, now_s + ANSWER_AGAIN_AFTER_S
        if frame.time_us == self._time_us:
            self._answer_again()
            return None
        if self._zero_us is None or (self._time_us is not None and frame.time_us < self._time_us):
            self._zero_us, self._fix = frame.time_us, None
        self._time_us, self._answer = frame.time_us, None
        time_us = frame.time_us - self._zero_us
        fix, self._fix = self._fix, None
        gps = None if fix is None else replace(fix, time_us=time_us)
        updated = frame.updated & _EVERYTHING or _EVERYTHING
        return frame._replace(time_us=time_us, updated=updated, gps=gps)
