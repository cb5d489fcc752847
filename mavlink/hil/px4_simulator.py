"""PX4's simulator interface, the simulator's end, as a state machine: what came and the time in, datagrams out.

PX4 calls (over TCP it is the client), begins with a HEARTBEAT and, before or after, asks for HIL_STATE_QUATERNION.
HIL_SENSOR sets its clock; its HIL_ACTUATOR_CONTROLS with bit 0 of `flags` answers it. Until the first such answer,
while PX4 is starting, the simulator must go on by itself, at the pace of the wall clock. From then on it waits for
each.

An answer is known by its time, which must be another than that of the answer before: a frame that was lost and sent
again is answered twice, and counts once. Source: PX4-Autopilot, simulator_mavlink/SimulatorMavlink.cpp, and
https://docs.px4.io/main/en/simulation/.
"""

from collections import Counter
from math import isfinite
from typing import NamedTuple

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Address, FourRotors, Vector
from colibri.mavlink.hil.lockstep import HEARTBEAT_EVERY_US, encode_heartbeat
from colibri.mavlink.hil.sensors import SensorFrame, encode_sensors
from colibri.mavlink.hil.state import LOCKSTEP_FLAG, ROTORS, StateFrame
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec, Message
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

RESEND_AFTER_S = 1.0
"""Wall-clock silence after which a frame is sent again: PX4 may have been restarted, or a datagram lost."""
CALL_EVERY_S = 0.5

_BEGINNING = ("HEARTBEAT", "COMMAND_LONG")
_STOPPED: FourRotors = (0.0, 0.0, 0.0, 0.0)
_G_M_S2 = 9.80665
_INT16_MAX, _UINT16_MAX = 32767, 65535


class Motors(NamedTuple):
    """What PX4 commands: controls, 0 to 1, of its first four motors in its own order."""

    controls: FourRotors
    armed: bool


class Truth(NamedTuple):
    """The true state that HIL_STATE_QUATERNION holds, its acceleration against the ground: PX4 only logs it."""

    state: StateFrame
    place: Geodetic
    acceleration_enu_m_s2: Vector
    airspeed_m_s: float


class SimulatorEnd:
    """The simulator's end: offers frames, receives motor commands.

    It has more attributes than most classes: they are one conversation, as those of `PlantEnd`.

    Attributes:
        peer: Where PX4 is; None until it has called, and after it has gone.
        calls: How many times a PX4 has begun to be served.
        lockstep: Whether PX4 answers each frame, and is to be waited for.
        received: Frames of PX4 that were understood, in order; the owner may log and clear it.
    """

    def __init__(self, *, system_id: int) -> None:
        """Speak as the simulator of the autopilot of `system_id`."""
        self._codec = Codec(system_id, dialect.PLANT_COMPONENT)
        self.peer: Address | None = None
        self.calls = 0
        self.lockstep = False
        self.answered = True
        self.motors = Motors(_STOPPED, armed=False)
        self.resent = 0
        self.dropped: Counter[str] = self._codec.dropped
        self.received: list[bytes] = []
        self._answer_us: int | None = None
        self._truth_every_us: int | None = None
        self._truth_at_us = 0
        self._frames: tuple[bytes, ...] = ()
        self._resend_at_s = 0.0
        self._call_at_s = 0.0
        self._outbox: list[tuple[tuple[bytes, ...], Address]] = []

    def wants_truth(self, time_us: int) -> bool:
        """Whether PX4 has requested the true state, and it is due."""
        return self._truth_every_us is not None and time_us >= self._truth_at_us

    def offer(self, frame: SensorFrame, truth: Truth | None, now_s: float) -> None:
        """Send a frame, with the truth if it is wanted, and await its answer."""
        frames = [] if truth is None else [self._encode_truth(truth)]
        frames += encode_sensors(self._codec, frame)
        if frame.time_us % HEARTBEAT_EVERY_US == 0:
            frames.append(self._heartbeat())
        self._frames = tuple(frames)
        self.answered = False
        self._send(now_s)

    def receive(self, datagram: bytes, sender: Address) -> None:
        """Take in what one sender has sent."""
        for message in self._codec.decode(datagram):
            if message.name in _BEGINNING and self.peer is None:
                self._begin(sender)
            if sender != self.peer:
                self.dropped["second autopilot" if self.peer else "not begun"] += 1
                continue
            if message.name == "HIL_ACTUATOR_CONTROLS":
                self._obey(message)
            elif message.name == "COMMAND_LONG":
                self._receive_request(message)
            elif message.name != "HEARTBEAT":
                self.dropped["unexpected"] += 1
                continue
            self.received.append(message.frame)

    def close(self, address: Address) -> None:
        """Forget a PX4 whose connection has ended."""
        if address == self.peer:
            self.peer = None

    def call(self, address: Address, now_s: float) -> None:
        """Call a PX4 that waits to be called, as it does over UDP, now and then until it speaks."""
        if self.peer is None and now_s >= self._call_at_s:
            self._call_at_s = now_s + CALL_EVERY_S
            self._outbox.append(((self._heartbeat(),), address))

    def poll(self, now_s: float) -> None:
        """Send the frame again if its answer is overdue."""
        if not self.answered and now_s >= self._resend_at_s:
            self.resent += 1
            self._send(now_s)

    def take_outbox(self) -> list[tuple[tuple[bytes, ...], Address]]:
        """Return the frames to send now and where each datagram of them goes, and forget them."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def _send(self, now_s: float) -> None:
        self._resend_at_s = now_s + RESEND_AFTER_S
        if self.peer is not None:
            self._outbox.append((self._frames, self.peer))

    def _begin(self, sender: Address) -> None:
        self.peer = sender
        self.calls += 1
        self.lockstep, self.answered = False, True
        self.motors = Motors(_STOPPED, armed=False)
        self._answer_us = self._truth_every_us = None

    def _obey(self, message: Message) -> None:
        fields = message.fields
        if fields.time_usec == self._answer_us:
            self.dropped["repeated"] += 1
            return
        self._answer_us = fields.time_usec
        self.lockstep = bool(fields.flags & LOCKSTEP_FLAG)
        self.answered = True
        controls = fields.controls[:ROTORS]
        if all(map(isfinite, controls)):
            a, b, c, d = (min(max(control, 0.0), 1.0) for control in controls)
            self.motors = Motors((a, b, c, d), bool(fields.mode & dialect.MODE_ARMED))
        else:
            self.dropped["invalid"] += 1

    def _receive_request(self, message: Message) -> None:
        fields = message.fields
        wanted = (dialect.CMD_SET_MESSAGE_INTERVAL, dialect.MSG_HIL_STATE_QUATERNION)
        if (fields.command, fields.param1) != wanted or not isfinite(fields.param2):
            self.dropped["unexpected"] += 1
            return
        self._truth_every_us = round(fields.param2) if fields.param2 > 0.0 else None
        self._truth_at_us = 0

    def _heartbeat(self) -> bytes:
        return encode_heartbeat(self._codec, dialect.TYPE_GENERIC, dialect.AUTOPILOT_INVALID, armed=False)

    def _encode_truth(self, truth: Truth) -> bytes:
        state, place = truth.state, truth.place
        assert self._truth_every_us is not None, "it is sent on request"
        self._truth_at_us = state.time_us + self._truth_every_us
        airspeed = min(round(truth.airspeed_m_s * 1e2), _UINT16_MAX)
        return self._codec.encode(
            "HIL_STATE_QUATERNION",
            state.time_us,
            ned_frd_from_enu_flu(state.attitude),
            *frd_from_flu(state.rate_flu_rad_s),
            round(place.latitude_deg * 1e7),
            round(place.longitude_deg * 1e7),
            round(place.altitude_m * 1e3),
            *(_signed(speed * 1e2) for speed in ned_from_enu(state.velocity_enu_m_s)),
            airspeed,
            airspeed,
            *(_signed(part / _G_M_S2 * 1e3) for part in ned_from_enu(truth.acceleration_enu_m_s2)),
        )


def _signed(value: float) -> int:
    return max(-_INT16_MAX, min(_INT16_MAX, round(value)))
