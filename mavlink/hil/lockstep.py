"""The lockstep conversation between plant and autopilot, its two ends as state machines without input or output.

Datagrams and the wall-clock time go in, datagrams come out. The plant sends the frame of time t and advances only
with the command that names t, so nothing that a link does to datagrams can change a flight:

- a frame unanswered for `RESEND_AFTER_S` is sent again;
- a repeated frame gets the remembered answer, so each frame is computed once;
- what names another time than the one awaited is dropped.

The autopilot calls the plant with one datagram: SET_MESSAGE_INTERVAL (which message it wants, and how often:
ATTITUDE_QUATERNION for frames of the state, HIL_SENSOR for frames of sensors) and a HEARTBEAT. The plant begins with
the first such call, and answers an autopilot that was started again where the flight stands.

Beside its frame the plant sends its battery twice a second, and to whoever has just called; and where commands take
effect later than their frame, how much later the last one did (NAMED_VALUE_INT cmd_delay, µs). The autopilot may append
faults, COMMAND_LONG with MAV_CMD_INJECT_FAILURE, to the datagram that answers a frame: they are taken with that answer
and with no other datagram, so each happens once, at that time; the next frame brings their COMMAND_ACK.

A plant that runs freely waits for nobody: `FREE_RUNNING` in its HEARTBEAT. It sends each frame once, and takes any
answer that is newer than the last. The autopilot then goes on from whatever newer frame it gets. How a plant runs is
learnt from its first HEARTBEAT, and again after silence. A plant that waits begins a new flight at time 0 and with no
other frame.
"""

from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import OWN_MESSAGES
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec

RESEND_AFTER_S = 0.02
"""Wall-clock silence after which the plant sends its frame again."""
PEER_LOST_AFTER_S = 0.5
"""Wall-clock silence after which another autopilot may take over the plant."""
CALL_AFTER_S = 1.0
"""Wall-clock silence after which the autopilot calls the plant again, and would begin a new flight."""
CALL_EVERY_S = 0.05
HEARTBEAT_EVERY_US = 1_000_000
BATTERY_EVERY_US = 500_000
FREE_RUNNING = 1
"""HEARTBEAT.custom_mode of a plant that does not wait for answers."""
MIN_FRAME_INTERVAL_US = 1_000
MAX_FRAME_INTERVAL_US = 1_000_000

ASKED_BY = {Feedback.STATE: dialect.MSG_ATTITUDE_QUATERNION, Feedback.SENSORS: dialect.MSG_HIL_SENSOR}
"""The message whose interval an autopilot sets."""
ASKS_FOR = {message_id: feedback for feedback, message_id in ASKED_BY.items()}
MADE_OF = {
    Feedback.STATE: ("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED"),
    Feedback.SENSORS: ("HIL_SENSOR", *(row.message for row in OWN_MESSAGES)),
}


def encode_heartbeat(codec: Codec, kind: int, autopilot: int, armed: bool, custom_mode: int = 0) -> bytes:
    """Return a heartbeat's frame."""
    mode = dialect.MODE_ARMED if armed else 0
    return codec.encode("HEARTBEAT", kind, autopilot, mode, custom_mode, dialect.STATE_ACTIVE, 3)
