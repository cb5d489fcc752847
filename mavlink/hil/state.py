"""State frames and commands between plant and autopilot, in SI, ENU/FLU, and as MAVLink; invalid input is `None`."""

from array import array
from collections.abc import Sequence
from functools import cache
from math import isfinite, sqrt
from typing import Any

from colibri.common.records import Record
from colibri.common.types import PerRotor, Quaternion, Vector
from colibri.mavlink.wire.dialect import MODE_ARMED, MODE_CUSTOM, MODE_HIL, Codec, Message
from colibri.mavlink.wire.fixed_frames import FixedFrame
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu

ROTORS = 4  # of a plant that is not told otherwise
LOCKSTEP_FLAG = 1  # HIL_ACTUATOR_CONTROLS.flags bit 0: the simulator waits for this message
_FRAMES_BIT, MAX_FRAMES = 8, 1 << 16  # from bit 8, 16 bits: how many further frames it answers

UNIT_NORM_TOLERANCE = 1e-3
_ATTITUDE = FixedFrame("ATTITUDE_QUATERNION", "time_boot_ms q1 q2 q3 q4 rollspeed pitchspeed yawspeed")
_POSITION = FixedFrame("LOCAL_POSITION_NED", "time_boot_ms x y z vx vy vz")
STATE_MESSAGES = 2
STATE_BYTES = _ATTITUDE.size + _POSITION.size  # of a datagram of state feedback alone
_DISARMED = MODE_CUSTOM | MODE_HIL
_ARMED = _DISARMED | MODE_ARMED


@cache
def actuator_frame(rotors: int) -> FixedFrame:
    """Return the layout of HIL_ACTUATOR_CONTROLS with its first controls, at most 16."""
    return FixedFrame("HIL_ACTUATOR_CONTROLS", f"time_usec flags controls[{rotors}] mode")


class StateFrame(Record, frozen=True):
    """The vehicle's state at one instant of simulated time."""

    time_us: int  # whole milliseconds on the wire
    position_enu_m: Vector
    velocity_enu_m_s: Vector
    attitude: Quaternion  # FLU to ENU
    rate_flu_rad_s: Vector


class ActuatorCommand(Record, frozen=True):
    """Rotor speeds in answer to the frame of `time_us`, 0..1 of the maximum."""

    time_us: int
    controls: PerRotor
    armed: bool
    frames: int = 1  # that it answers, from that one on


def encode_state(codec: Codec, frame: StateFrame) -> list[bytes]:
    (x, y, z), (vx, vy, vz), (p, q, r) = frame.position_enu_m, frame.velocity_enu_m_s, frame.rate_flu_rad_s
    time_ms = frame.time_us // 1000
    turning = _ATTITUDE.encode(codec, (time_ms, *ned_frd_from_enu_flu(frame.attitude), p, -q, -r))
    return [turning, _POSITION.encode(codec, (time_ms, y, x, -z, vy, vx, -vz))]


def read_state(datagram: bytes, source: bytes) -> StateFrame | None:
    """Read a datagram of exactly the two full-length frames of `source`; otherwise `None`."""
    if len(datagram) != STATE_BYTES:
        return None
    attitude = _ATTITUDE.read(datagram, 0, source)
    position = _POSITION.read(datagram, _ATTITUDE.size, source)
    return _state(attitude, position) if attitude and position else None


def decode_state(attitude: Message, position: Message) -> StateFrame | None:
    return _state(_ATTITUDE.numbers(attitude.fields), _POSITION.numbers(position.fields))


def _state(attitude: Sequence[Any], position: Sequence[Any]) -> StateFrame | None:
    attitude_ms, q1, q2, q3, q4, p, q, r = attitude
    position_ms, north, east, down, vn, ve, vd = position
    if attitude_ms != position_ms:
        return None
    return _frame(attitude_ms * 1000, (q1, q2, q3, q4, east, north, -down, ve, vn, -vd, p, -q, -r))


def _frame(time_us: int, numbers: Sequence[float]) -> StateFrame | None:
    """Return a frame of an attitude in NED/FRD, then position, velocity and rates in ENU/FLU."""
    q1, q2, q3, q4, x, y, z, vx, vy, vz, p, q, r = numbers
    squared = q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4
    # Numbers are single floats: their sum is finite if each of them is.
    if not abs(squared - 1.0) < UNIT_NORM_TOLERANCE or not isfinite(x + y + z + vx + vy + vz + p + q + r):
        return None
    norm = sqrt(squared)
    unit = ned_frd_from_enu_flu((q1 / norm, q2 / norm, q3 / norm, q4 / norm))
    return StateFrame(time_us, (x, y, z), (vx, vy, vz), unit, (p, q, r))


def encode_actuators(codec: Codec, command: ActuatorCommand) -> bytes:
    controls, mode = command.controls, _ARMED if command.armed else _DISARMED
    flags = LOCKSTEP_FLAG | command.frames - 1 << _FRAMES_BIT
    return actuator_frame(len(controls)).encode(codec, (command.time_us, flags, *controls, mode))


def command_as_received(command: ActuatorCommand) -> ActuatorCommand:
    """Return a valid command as rounded by `encode_actuators` and `read_actuators`."""
    return ActuatorCommand(command.time_us, tuple(array("f", command.controls)), command.armed, command.frames)


def read_actuators(datagram: bytes, source: bytes, rotors: int = ROTORS) -> ActuatorCommand | None:
    """Read a datagram of nothing but a valid command of `source`; otherwise `None`."""
    layout = actuator_frame(rotors)
    numbers = layout.read(datagram, 0, source) if len(datagram) == layout.size else None
    return _command(numbers) if numbers else None


def decode_actuators(message: Message, rotors: int = ROTORS) -> ActuatorCommand | None:
    return _command(actuator_frame(rotors).numbers(message.fields))


def _command(numbers: Sequence[Any]) -> ActuatorCommand | None:
    time_us, flags, *controls, mode = numbers
    return _within_range(time_us, tuple(controls), bool(mode & MODE_ARMED), (flags >> _FRAMES_BIT) % MAX_FRAMES + 1)


def _within_range(time_us: int, controls: PerRotor, armed: bool, frames: int) -> ActuatorCommand | None:
    for control in controls:
        if not 0.0 <= control <= 1.0:
            return None
    return ActuatorCommand(time_us, controls, armed, frames)
