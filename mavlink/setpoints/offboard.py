"""The offboard microservice: setpoints streamed by a client, https://mavlink.io/en/services/offboard_control.html.

An invalid setpoint is counted and dropped with a STATUSTEXT. SET_ACTUATOR_CONTROL_TARGET is ignored: only the control
law commands rotors. Choices left open by the specification:

- NaN counts as masked, as in PX4: x and y of a group together, z alone.
- Undefined bits of a type mask are ignored.
- Body frames are level: they turn with the heading, not with roll and pitch.
- One masked horizontal axis of a group in a body frame means: keep this position, zero velocity, zero acceleration.
"""

from collections.abc import Mapping
from math import hypot, isfinite, isnan, nan, pi, sqrt
from typing import Any, NamedTuple

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic
from colibri.common.kernels import cos, sin
from colibri.common.records import Record
from colibri.common.rotations import nearest_turn
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.command import DEGREES, GLOBAL_FRAMES
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.setpoints.arbitration import Refused, StreamedService
from colibri.mavlink.setpoints.setpoints import NOWHERE, AttitudeSetpoint, OffboardSetpoint, PositionSetpoint, turned
from colibri.mavlink.telemetry.snapshot import HomePosition
from colibri.mavlink.wire.dialect import Message, Refusal, bits, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu
from colibri.mavlink.wire.places import ABOVE_SEA, MAX_DISTANCE_M, read_place

MAX_SPEED_M_S = 50.0
MAX_ACCELERATION_M_S2 = 50.0
MAX_YAW_RATE_RAD_S = 35.0  # of body rates: 2000 degrees a second, the range of usual gyroscopes
MAX_YAW_RAD = 1e3
MAX_BELOW_M = 10.0  # of positions below the ground, which lead to a landing
UNIT_WITHIN = 0.01  # tolerance of a quaternion's length: clients use single precision, some round

_POSITION, _VELOCITY, _ACCELERATION = 0, 3, 6  # first bits of POSITION_TARGET_TYPEMASK
_FORCE: int = mav.POSITION_TARGET_TYPEMASK_FORCE_SET
_NO_YAW: int = mav.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_NO_YAW_RATE: int = mav.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
_NO_RATE = [bits("ATTITUDE_TARGET_TYPEMASK_BODY_", f"{axis}_RATE_IGNORE") for axis in ("ROLL", "PITCH", "YAW")]
_NO_THRUST: int = mav.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE
_NO_ATTITUDE: int = mav.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE


class Frame(NamedTuple):
    """Meaning of a local MAV_FRAME."""

    from_vehicle: bool = False  # positions are relative to the vehicle
    turned_position: bool = False  # positions are along the heading
    body: bool = False  # velocities and accelerations are along the heading
    turned_yaw: bool = False  # yaw is relative to the heading
    up: bool = False  # FLU, not FRD


_ALONG_HEADING = Frame(from_vehicle=True, turned_position=True, body=True, turned_yaw=True)
LOCAL_FRAMES: dict[int, Frame] = {
    mav.MAV_FRAME_LOCAL_NED: Frame(),
    mav.MAV_FRAME_LOCAL_OFFSET_NED: Frame(from_vehicle=True),
    # "Same as MAV_FRAME_LOCAL_NED when used to represent position values. Same as MAV_FRAME_BODY_FRD when used with
    # velocity/acceleration values." Yaw stays from north, as PX4 has it.
    mav.MAV_FRAME_BODY_NED: Frame(body=True),
    mav.MAV_FRAME_BODY_OFFSET_NED: _ALONG_HEADING,  # "This is the same as MAV_FRAME_BODY_FRD."
    mav.MAV_FRAME_BODY_FRD: _ALONG_HEADING,
    mav.MAV_FRAME_LOCAL_FRD: _ALONG_HEADING._replace(from_vehicle=False),
    mav.MAV_FRAME_LOCAL_FLU: _ALONG_HEADING._replace(from_vehicle=False, up=True),
}


class Whereabouts(Record, frozen=True):
    position_enu_m: Vector = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0
    origin: Geodetic = DEFAULT_ORIGIN
    home: HomePosition | None = None


def decode_local(
    fields: Any, here: Whereabouts, now_us: int, frames: Mapping[int, Frame] = LOCAL_FRAMES
) -> PositionSetpoint:
    frame = frames.get(fields.coordinate_frame)
    if frame is None:
        raise Refused("not local", f"frame {fields.coordinate_frame}")
    velocity, acceleration = _derivatives(fields, body=frame.body, up=frame.up)
    wire = (fields.x, fields.y, fields.z)
    place = group("position", wire, fields.type_mask >> _POSITION, MAX_DISTANCE_M, by_axis=True)
    yaw_rad, yaw_rate_rad_s = _yaw(fields, here.yaw_rad if frame.turned_yaw else 0.5 * pi, up=frame.up)
    position = _position_from(place, frame, here)
    setpoint = PositionSetpoint(position, velocity, acceleration, yaw_rad, yaw_rate_rad_s, frame.body, now_us)
    return _checked(setpoint, fields.type_mask, here)


def decode_global(fields: Any, here: Whereabouts, now_us: int) -> PositionSetpoint:
    if fields.coordinate_frame not in GLOBAL_FRAMES:
        raise Refused("not global", f"frame {fields.coordinate_frame}")
    velocity, acceleration = _derivatives(fields, body=False, up=False)
    yaw_rad, yaw_rate_rad_s = _yaw(fields, 0.5 * pi, up=False)
    position = _position_of(fields, here)
    setpoint = PositionSetpoint(position, velocity, acceleration, yaw_rad, yaw_rate_rad_s, time_us=now_us)
    return _checked(setpoint, fields.type_mask, here)


def decode_attitude(fields: Any, now_us: int) -> AttitudeSetpoint:
    mask = fields.type_mask
    masked = sum(1 << axis for axis, bit in enumerate(_NO_RATE) if mask & bit)
    wire = (fields.body_roll_rate, fields.body_pitch_rate, fields.body_yaw_rate)
    rate = frd_from_flu(group("body rates", wire, masked, MAX_YAW_RATE_RAD_S))
    attitude = None if mask & _NO_ATTITUDE else _attitude(fields.q)
    thrust = nan if mask & _NO_THRUST else fields.thrust
    if not mask & _NO_THRUST and not 0.0 <= thrust <= 1.0:
        raise Refused("out of range" if isfinite(thrust) else "not finite", f"thrust {thrust:g}")
    if attitude is None and all(map(isnan, rate)):
        raise Refused("empty", f"type_mask {mask:#x}")
    return AttitudeSetpoint(attitude, rate, thrust, now_us)


def _position_from(place: Vector, frame: Frame, here: Whereabouts) -> Vector:
    if frame.turned_position:
        x, y, z = _along_heading(place if frame.up else frd_from_flu(place), frame, here)
    else:
        x, y, z = ned_from_enu(place)
    if not frame.from_vehicle:
        return (x, y, z)
    px, py, pz = here.position_enu_m
    return (px + x, py + y, pz + z)


def _along_heading(flu: Vector, frame: Frame, here: Whereabouts) -> Vector:
    """Return a position along the heading in ENU; a masked horizontal axis keeps its place."""
    ahead, left, up = flu
    if isnan(ahead) != isnan(left):
        c, s = cos(here.yaw_rad), sin(here.yaw_rad)
        px, py = (0.0, 0.0) if frame.from_vehicle else here.position_enu_m[:2]
        ahead = c * px + s * py if isnan(ahead) else ahead
        left = c * py - s * px if isnan(left) else left
    return turned((ahead, left, up), here.yaw_rad)


def _position_of(fields: Any, here: Whereabouts) -> Vector:
    no_latitude, no_longitude, no_altitude = (bool(fields.type_mask >> axis & 1) for axis in range(3))
    latitude = here.origin.latitude_deg if no_latitude else fields.lat_int * DEGREES
    longitude = here.origin.longitude_deg if no_longitude else fields.lon_int * DEGREES
    if no_latitude and no_longitude:
        latitude = longitude = nan
    altitude_m = single("altitude", fields.alt, no_altitude, MAX_DISTANCE_M)
    frame = fields.coordinate_frame
    if here.home is None and frame not in ABOVE_SEA and not isnan(altitude_m):
        raise Refused("no home", f"altitude {altitude_m:g} above home")
    home_up_m = here.home.position_enu_m[2] if here.home else 0.0
    place = read_place(latitude, longitude, altitude_m, frame, home_up_m=home_up_m, origin=here.origin)
    if isinstance(place, Refusal):
        raise Refused("out of range", place.reason)
    east, north, up = place
    return (nan if no_longitude else east, nan if no_latitude else north, nan if isnan(altitude_m) else up)


def group(name: str, wire: Vector, masked: int, maximum: float, *, by_axis: bool = False) -> Vector:
    """Return a group's fields, nan if masked (bit n of `masked`); the others are at most `maximum` long.

    NaN masks all of a group; `by_axis` it masks x and y, or z alone.
    """
    x, y, z = (nan if masked >> axis & 1 else value for axis, value in enumerate(wire))
    given = [value for axis, value in enumerate(wire) if not masked >> axis & 1 and not isnan(value)]
    if not given:
        return NOWHERE
    whole = isnan(x) == isnan(y) or bool(masked & 0b11) if by_axis else masked.bit_count() + len(given) == len(wire)
    if not whole or not all(map(isfinite, given)):
        raise Refused("not finite", _listed(name, wire, masked))
    if hypot(*given) > maximum:
        raise Refused("out of range", _listed(name, wire, masked))
    return (x, y, z)


def _listed(name: str, wire: Vector, masked: int) -> str:
    return f"{name} {', '.join(f'{value:g}' for axis, value in enumerate(wire) if not masked >> axis & 1)}"


def single(name: str, wire: float, masked: int, maximum: float) -> float:
    value, _, _ = group(name, (wire, nan, nan), 0b110 | bool(masked), maximum)
    return value


def _derivatives(fields: Any, *, body: bool, up: bool) -> tuple[Vector, Vector]:
    mask = fields.type_mask
    velocity = group("velocity", (fields.vx, fields.vy, fields.vz), mask >> _VELOCITY, MAX_SPEED_M_S, by_axis=True)
    wire = (fields.afx, fields.afy, fields.afz)
    acceleration = group("acceleration", wire, mask >> _ACCELERATION, MAX_ACCELERATION_M_S2, by_axis=True)
    if mask & _FORCE and not all(map(isnan, acceleration)):
        raise Refused("force", f"type_mask {mask:#x}")
    if not body:
        return ned_from_enu(velocity), ned_from_enu(acceleration)
    if not up:
        velocity, acceleration = frd_from_flu(velocity), frd_from_flu(acceleration)
    return _whole(velocity), _whole(acceleration)


def _whole(flu: Vector) -> Vector:
    ahead, left, up = flu
    if isnan(ahead) == isnan(left):
        return flu
    return (0.0 if isnan(ahead) else ahead, 0.0 if isnan(left) else left, up)


def _yaw(fields: Any, zero_rad: float, *, up: bool) -> tuple[float, float]:
    yaw = single("yaw", fields.yaw, fields.type_mask & _NO_YAW, MAX_YAW_RAD)
    rate = single("yaw rate", fields.yaw_rate, fields.type_mask & _NO_YAW_RATE, MAX_YAW_RATE_RAD_S)
    turn = 1.0 if up else -1.0
    return (nan if isnan(yaw) else nearest_turn(zero_rad + turn * yaw, 0.0), turn * rate)


def _attitude(q: Any) -> Quaternion:
    w, x, y, z = q
    length = sqrt(w * w + x * x + y * y + z * z)
    if not isfinite(length):
        raise Refused("not finite", _listed("quaternion", q, 0))
    if abs(length - 1.0) > UNIT_WITHIN:
        raise Refused("not a unit quaternion", _listed("quaternion", q, 0))
    return ned_frd_from_enu_flu((w / length, x / length, y / length, z / length))


def _checked(setpoint: PositionSetpoint, mask: int, here: Whereabouts) -> PositionSetpoint:
    position, velocity, acceleration, yaw_rad, yaw_rate_rad_s, *_ = setpoint
    if all(map(isnan, (*position, *velocity, *acceleration, yaw_rad, yaw_rate_rad_s))):
        raise Refused("empty", f"type_mask {mask:#x}")
    below_m = min(0.0, here.home.position_enu_m[2] if here.home else 0.0) - position[2]
    if below_m > MAX_BELOW_M:
        raise Refused("out of range", f"position {below_m:.0f} m below the ground")
    return setpoint


class Offboard(StreamedService[OffboardSetpoint]):
    """Keeps each client's latest offboard setpoint."""

    handles = frozenset({"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"})

    def __init__(self, text: StatusText | None = None, frames: Mapping[int, Frame] = LOCAL_FRAMES) -> None:
        super().__init__(text=text)
        self._here, self._frames = Whereabouts(), frames

    def update(self, position_enu_m: Vector, yaw_rad: float, origin: Geodetic, home: HomePosition | None) -> None:
        self._here = Whereabouts(position_enu_m, yaw_rad, origin, home)

    def latest(self, now_us: int, timeout_us: int) -> OffboardSetpoint | None:
        return self._latest(now_us, timeout_us)

    def _decode(self, message: Message, _peer: Peer, now_us: int) -> OffboardSetpoint:
        if message.name == "SET_POSITION_TARGET_LOCAL_NED":
            return decode_local(message.fields, self._here, now_us, self._frames)
        if message.name == "SET_POSITION_TARGET_GLOBAL_INT":
            return decode_global(message.fields, self._here, now_us)
        return decode_attitude(message.fields, now_us)
