"""What plant and autopilot send each other: dataclasses in SI, ENU/FLU, and their MAVLink messages.

Anything that a receiver could not fly on (not finite, out of range, halves of different frames) decodes to None.
"""

from dataclasses import dataclass
from math import isfinite

from colibri.common.rotations import normalized
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.wire.dialect import MODE_ARMED, MODE_CUSTOM, MODE_HIL, Codec, Message
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

ROTORS = 4
LOCKSTEP_FLAG = 1
"""HIL_ACTUATOR_CONTROLS.flags bit 0: the simulator waits for this message."""

_CONTROLS_ON_WIRE = 16
_UNIT_NORM_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class StateFrame:
    """The vehicle's state at one instant of simulated time.

    Attributes:
        time_us: Simulated time, µs; whole milliseconds on the wire.
        attitude: Unit quaternion, FLU body to ENU earth.
    """

    time_us: int
    position_enu_m: Vector
    velocity_enu_m_s: Vector
    attitude: Quaternion
    rate_flu_rad_s: Vector


@dataclass(frozen=True, slots=True)
class ActuatorCommand:
    """The rotor speeds that answer the frame of `time_us`, 0..1 of the maximum, in the vehicle's rotor order."""

    time_us: int
    controls: tuple[float, float, float, float]
    armed: bool


def encode_state(codec: Codec, frame: StateFrame) -> list[bytes]:
    """Encode a frame as ATTITUDE_QUATERNION and LOCAL_POSITION_NED of the same `time_boot_ms`."""
    time_boot_ms = frame.time_us // 1000
    return [
        codec.encode(
            "ATTITUDE_QUATERNION",
            time_boot_ms,
            *ned_frd_from_enu_flu(frame.attitude),
            *frd_from_flu(frame.rate_flu_rad_s),
        ),
        codec.encode(
            "LOCAL_POSITION_NED",
            time_boot_ms,
            *ned_from_enu(frame.position_enu_m),
            *ned_from_enu(frame.velocity_enu_m_s),
        ),
    ]


def decode_state(attitude: Message, position: Message) -> StateFrame | None:
    """Decode an ATTITUDE_QUATERNION and a LOCAL_POSITION_NED; None if they cannot be one frame."""
    a, p = attitude.fields, position.fields
    q = (a.q1, a.q2, a.q3, a.q4)
    vectors = (a.rollspeed, a.pitchspeed, a.yawspeed, p.x, p.y, p.z, p.vx, p.vy, p.vz)
    is_unit = abs(sum(component * component for component in q) - 1.0) < _UNIT_NORM_TOLERANCE
    if a.time_boot_ms != p.time_boot_ms or not all(map(isfinite, vectors)) or not is_unit:
        return None
    return StateFrame(
        time_us=a.time_boot_ms * 1000,
        position_enu_m=ned_from_enu((p.x, p.y, p.z)),
        velocity_enu_m_s=ned_from_enu((p.vx, p.vy, p.vz)),
        attitude=ned_frd_from_enu_flu(normalized(q)),
        rate_flu_rad_s=frd_from_flu((a.rollspeed, a.pitchspeed, a.yawspeed)),
    )


def encode_actuators(codec: Codec, command: ActuatorCommand) -> bytes:
    """Encode a command as HIL_ACTUATOR_CONTROLS."""
    mode = MODE_CUSTOM | MODE_HIL | (MODE_ARMED if command.armed else 0)
    controls = [*command.controls, *([0.0] * (_CONTROLS_ON_WIRE - ROTORS))]
    return codec.encode("HIL_ACTUATOR_CONTROLS", command.time_us, controls, mode, LOCKSTEP_FLAG)


def decode_actuators(message: Message) -> ActuatorCommand | None:
    """Decode a HIL_ACTUATOR_CONTROLS; None if a rotor could not follow it."""
    c1, c2, c3, c4 = message.fields.controls[:ROTORS]
    if not all(0.0 <= control <= 1.0 for control in (c1, c2, c3, c4)):
        return None
    return ActuatorCommand(message.fields.time_usec, (c1, c2, c3, c4), bool(message.fields.mode & MODE_ARMED))
