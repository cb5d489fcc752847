"""The lockstep protocol between plant and autopilot, both ends as state machines without I/O.

The plant sends the frame of time t and advances only with the command that names t, so no link can change a flight:

- an unanswered frame is sent again after `RESEND_AFTER_S`;
- a repeated frame gets the remembered answer, so each frame is computed once;
- messages of a time other than the awaited one are dropped.

Between two control samples the command stays. To a plant that takes answers ahead (`TAKES_AHEAD` in its HEARTBEAT), an
autopilot without ground stations therefore answers a control sample and all frames up to the next one by one command,
which holds their number (HIL_ACTUATOR_CONTROLS.flags, bits 8 to 23: how many more). The plant advances through these
frames without waiting; it does not send those that hold only a state.

The autopilot calls the plant with one datagram: SET_MESSAGE_INTERVAL (ATTITUDE_QUATERNION for state frames, HIL_SENSOR
for sensor frames) and a HEARTBEAT. The plant begins with the first such call, and resumes with a restarted autopilot.

With its frame the plant sends its battery twice a second and to each new caller, and the delay of the last command's
effect, if any (NAMED_VALUE_INT cmd_delay, µs). Faults, COMMAND_LONG with MAV_CMD_INJECT_FAILURE, are accepted only
appended to the answer of a frame, so each happens once, at that time; the next frame brings their COMMAND_ACK.

A free-running plant (`FREE_RUNNING`) sends each frame once and accepts any newer answer; the autopilot
continues from the newest frame. In lockstep a new flight begins at time 0 only.
"""

from collections import Counter
from collections.abc import Callable

from colibri.common.types import Address
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import OWN_MESSAGES
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec

RESEND_AFTER_S = 0.02  # wall-clock silence before the plant repeats its frame
PEER_LOST_AFTER_S = 0.5  # wall-clock silence before another may take over, if the first one's address is free
PEER_GIVEN_UP_AFTER_S = 10.0  # wall-clock silence before another may take over in any case
CALL_AFTER_S = 1.0  # wall-clock silence before the autopilot calls again, and a new flight may begin
CALL_EVERY_S = 0.05
HEARTBEAT_EVERY_US = 1_000_000
BATTERY_EVERY_US = 500_000
FREE_RUNNING, TAKES_AHEAD = 1, 3  # HEARTBEAT.custom_mode of a free-running plant, and of one that takes answers ahead
FRAME_INTERVALS_US = range(1_000, 1_000_001, 1_000)

ASKED_BY = {Feedback.STATE: dialect.MSG_ATTITUDE_QUATERNION, Feedback.SENSORS: dialect.MSG_HIL_SENSOR}
"""The message for which an autopilot sets the interval."""
ASKS_FOR = {message_id: feedback for feedback, message_id in ASKED_BY.items()}
MADE_OF = {
    Feedback.STATE: ("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED"),
    Feedback.SENSORS: ("HIL_SENSOR", *(row.message for row in OWN_MESSAGES)),
}


def next_battery_us(time_us: int) -> int:
    """Return the time of the next report of the battery after a frame."""
    return time_us - time_us % BATTERY_EVERY_US + BATTERY_EVERY_US


def encode_heartbeat(codec: Codec, kind: int, autopilot: int, armed: bool, custom_mode: int = 0) -> bytes:
    mode = dialect.MODE_ARMED if armed else 0
    return codec.encode("HEARTBEAT", kind, autopilot, mode, custom_mode, dialect.STATE_ACTIVE, 3)


def plant_heartbeat(codec: Codec, custom_mode: int = 0) -> bytes:
    return encode_heartbeat(codec, dialect.TYPE_GENERIC, dialect.AUTOPILOT_INVALID, False, custom_mode)


def is_another(
    sender: Address | None, peer: Address | None, silence_s: float, is_there: Callable[[Address], bool]
) -> bool:
    """Whether to refuse a sender, as the peer is still there."""
    if peer is None or sender == peer or silence_s >= PEER_GIVEN_UP_AFTER_S:
        return False
    return silence_s < PEER_LOST_AFTER_S or is_there(peer)


class AnsweringEnd:
    """Common parts of the autopilot's ends, which remember the last answer."""

    def __init__(self, system_id: int, received_s: float, call_at_s: float) -> None:
        self._codec = Codec(system_id, dialect.AUTOPILOT_COMPONENT)
        self.refused: int | None = None  # MAV_RESULT of the requested frames
        self.repeated = 0  # frames
        self.dropped: Counter[str] = self._codec.dropped
        self._time_us: int | None = None
        self._answer: bytes | None = None
        self._received_s, self._call_at_s = received_s, call_at_s
        self._outbox: list[bytes] = []

    def silence_s(self, now_s: float) -> float:
        return now_s - self._received_s

    def take_outbox(self) -> list[bytes]:
        outbox, self._outbox = self._outbox, []
        return outbox

    def _answer_again(self) -> None:
        self.repeated += 1
        if self._answer is not None:
            self._outbox.append(self._answer)

    def _heartbeat(self, armed: bool) -> bytes:
        return encode_heartbeat(self._codec, dialect.TYPE_QUADROTOR, dialect.AUTOPILOT_GENERIC, armed)
