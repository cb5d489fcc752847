"""PX4's simulator interface, the simulator's end, as a state machine without I/O.

PX4 calls, begins with a HEARTBEAT and may request HIL_STATE_QUATERNION. HIL_SENSOR sets its clock; its
HIL_ACTUATOR_CONTROLS with bit 0 of `flags` answers. Until the first such answer, while PX4 starts, the simulator
advances with the wall clock; then it waits for each. An answer counts if its time differs from the previous one's.

Source: PX4-Autopilot, simulator_mavlink/SimulatorMavlink.cpp.
"""

from collections import Counter
from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Address, PerRotor, Vector
from colibri.mavlink.hil.lockstep import HEARTBEAT_EVERY_US, plant_heartbeat
from colibri.mavlink.hil.sensors import SensorFrame, encode_sensors, in_i16, place_e7_mm
from colibri.mavlink.hil.state import LOCKSTEP_FLAG, ROTORS, StateFrame, actuator_frame
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec, Message
from colibri.mavlink.wire.fixed_frames import FixedFrame
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

RESEND_AFTER_S = 1.0  # wall-clock silence before a frame is repeated, as PX4 may have restarted
CALL_EVERY_S = 0.5
GIVEN_UP_AFTER_S = 30.0  # wall-clock silence before another caller takes over: PX4 starts slowly

_BEGINNING = ("HEARTBEAT", "COMMAND_LONG")
_G_M_S2 = 9.80665
_UINT16_MAX = 65535
_TRUTH = FixedFrame(
    "HIL_STATE_QUATERNION",
    "time_usec attitude_quaternion rollspeed pitchspeed yawspeed lat lon alt vx vy vz "
    "ind_airspeed true_airspeed xacc yacc zacc",
)


class Motors(NamedTuple):
    """Controls, 0..1, of PX4's first motors in its order."""

    controls: PerRotor
    armed: bool


class Truth(NamedTuple):
    """The true state for HIL_STATE_QUATERNION, with coordinate acceleration."""

    state: StateFrame
    place: Geodetic
    acceleration_enu_m_s2: Vector
    airspeed_m_s: float


class SimulatorEnd:
    def __init__(self, *, system_id: int, rotors: int = ROTORS) -> None:
        self._codec = Codec(system_id, dialect.PLANT_COMPONENT)
        self._controls, self._stopped = actuator_frame(rotors), Motors((0.0,) * rotors, armed=False)
        self.peer: Address | None = None
        self.calls = 0  # starts of PX4
        self.lockstep = False  # PX4 answers each frame
        self.answered = True
        self.motors = self._stopped
        self.resent = 0
        self.dropped: Counter[str] = self._codec.dropped
        self.received: list[bytes] = []  # valid frames; the owner may log and clear it
        self._source = b""
        self._answer_us: int | None = None
        self._truth_every_us: int | None = None
        self._truth_at_us = 0
        self._frames: tuple[bytes, ...] = ()
        self._now_s = self._resend_at_s = 0.0
        self._answered_s: float | None = None  # or begun
        self._call_at_s = 0.0
        self._outbox: list[tuple[tuple[bytes, ...], Address]] = []

    def wants_truth(self, time_us: int) -> bool:
        return self._truth_every_us is not None and time_us >= self._truth_at_us

    def offer(self, frame: SensorFrame, truth: Truth | None, now_s: float) -> None:
        frames = [] if truth is None else [self._encode_truth(truth)]
        frames += encode_sensors(self._codec, frame)
        if frame.time_us % HEARTBEAT_EVERY_US == 0:
            frames.append(plant_heartbeat(self._codec))
        self._frames = tuple(frames)
        self.answered = False
        self._send(now_s)

    def receive(self, datagram: bytes, sender: Address) -> None:
        if len(datagram) == self._controls.size and sender == self.peer:
            numbers = self._controls.read(datagram, 0, self._source)
            if numbers is not None:
                self._obey(numbers)
                self.received.append(datagram)
                return
        for message in self._codec.decode(datagram):
            given_up = self._answered_s is not None and self._now_s - self._answered_s >= GIVEN_UP_AFTER_S
            if message.name in _BEGINNING and (self.peer is None or (sender != self.peer and given_up)):
                self._begin(sender, message)
            if sender != self.peer:
                self.dropped["second autopilot" if self.peer else "not begun"] += 1
                continue
            if message.name == "HIL_ACTUATOR_CONTROLS":
                self._obey(self._controls.numbers(message.fields))
            elif message.name == "COMMAND_LONG":
                self._receive_request(message)
            elif message.name != "HEARTBEAT":
                self.dropped["unexpected"] += 1
                continue
            self.received.append(message.frame)

    def close(self, address: Address) -> None:
        if address == self.peer:
            self.peer = None

    def call(self, address: Address, now_s: float) -> None:
        """Call a PX4 that waits to be called, as over UDP."""
        if self.peer is None and now_s >= self._call_at_s:
            self._call_at_s = now_s + CALL_EVERY_S
            self._outbox.append(((plant_heartbeat(self._codec),), address))

    def poll(self, now_s: float) -> None:
        if not self.answered and now_s >= self._resend_at_s:
            self.resent += 1
            self._send(now_s)

    def take_outbox(self) -> list[tuple[tuple[bytes, ...], Address]]:
        outbox, self._outbox = self._outbox, []
        return outbox

    def _send(self, now_s: float) -> None:
        self._now_s = now_s
        if self._answered_s is None:
            self._answered_s = now_s
        self._resend_at_s = now_s + RESEND_AFTER_S
        if self.peer is not None:
            self._outbox.append((self._frames, self.peer))

    def _begin(self, sender: Address, message: Message) -> None:
        self.peer, self._source = sender, bytes(message.source)
        self.calls += 1
        self.lockstep, self.answered = False, True
        self.motors = self._stopped
        self._answer_us = self._truth_every_us = self._answered_s = None

    def _obey(self, numbers: Sequence[Any]) -> None:
        time_us, flags, *controls, mode = numbers
        if time_us == self._answer_us:
            self.dropped["repeated"] += 1
            return
        self._answer_us, self._answered_s = time_us, self._now_s
        self.lockstep = bool(flags & LOCKSTEP_FLAG)
        self.answered = True
        if not isfinite(sum(controls)):
            self.dropped["invalid"] += 1
            return
        within = tuple([min(max(control, 0.0), 1.0) for control in controls])
        self.motors = Motors(within, bool(mode & dialect.MODE_ARMED))

    def _receive_request(self, message: Message) -> None:
        fields = message.fields
        wanted = (dialect.CMD_SET_MESSAGE_INTERVAL, dialect.MSG_HIL_STATE_QUATERNION)
        if (fields.command, fields.param1) != wanted or not isfinite(fields.param2):
            self.dropped["unexpected"] += 1
            return
        self._truth_every_us = round(fields.param2) if fields.param2 > 0.0 else None
        self._truth_at_us = 0

    def _encode_truth(self, truth: Truth) -> bytes:
        state, place = truth.state, truth.place
        assert self._truth_every_us is not None, "it is sent on request"
        self._truth_at_us = state.time_us + self._truth_every_us
        airspeed = min(round(truth.airspeed_m_s * 1e2), _UINT16_MAX)
        velocity = [in_i16(each * 1e2) for each in ned_from_enu(state.velocity_enu_m_s)]
        acceleration = [in_i16(each / _G_M_S2 * 1e3) for each in ned_from_enu(truth.acceleration_enu_m_s2)]
        turning = (*ned_frd_from_enu_flu(state.attitude), *frd_from_flu(state.rate_flu_rad_s))
        where = (*place_e7_mm(place), *velocity)
        return _TRUTH.encode(self._codec, (state.time_us, *turning, *where, airspeed, airspeed, *acceleration))
