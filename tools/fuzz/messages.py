"""Messages with right CRCs and any contents, and an independent table of commands that a vehicle may accept."""

import random
import struct
from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite, isnan, nan, pi
from typing import Any, NamedTuple

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, is_on_earth
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.mavlink.wire.missing_messages import LATER

NOT_GIVEN = 2**31 - 1
MAX_SPEED_M_S = 25.0  # the most that parameter MPC_XY_VEL_MAX can be
_WITHOUT_PLACE = mav.MAV_FRAME_MISSION


class CommandParameters(NamedTuple):
    """Parameters of a command; x and y in degrees, nan if missing."""

    p1: float
    p2: float
    p3: float
    p4: float
    x: float
    y: float
    z: float


def asked(fields: Mapping[str, Any]) -> CommandParameters:
    p1, p2, p3, p4 = (fields[f"param{number}"] for number in range(1, 5))
    if "x" not in fields:
        return CommandParameters(p1, p2, p3, p4, fields["param5"], fields["param6"], fields["param7"])
    unknown = fields["frame"] == _WITHOUT_PLACE
    x, y = (nan if unknown or value == NOT_GIVEN else value * 1e-7 for value in (fields["x"], fields["y"]))
    return CommandParameters(p1, p2, p3, p4, x, y, fields["z"])


def _nan_or(value: float, allowed: Callable[[float], bool]) -> bool:
    return isnan(value) or allowed(value)


def _one_of(*allowed: float) -> Callable[[float], bool]:
    return lambda value: value in allowed


def _whole(minimum: int, maximum: int) -> Callable[[float], bool]:
    return lambda value: minimum <= value <= maximum and value == int(value)


def _speed(value: float) -> bool:
    return 0.0 < value <= MAX_SPEED_M_S


def _place(a: CommandParameters) -> bool:
    nowhere = isnan(a.x) and isnan(a.y)
    return (nowhere or is_on_earth(a.x, a.y)) and _nan_or(a.z, lambda z: abs(z) < 20_000.0)


SENSIBLE: Mapping[int, Callable[[CommandParameters], bool]] = {
    mav.MAV_CMD_COMPONENT_ARM_DISARM: lambda a: a.p1 in (0.0, 1.0),
    mav.MAV_CMD_DO_SET_MODE: lambda a: _whole(1, 255)(a.p1) and _whole(1, 255)(a.p2) and _nan_or(a.p3, _whole(0, 255)),
    mav.MAV_CMD_NAV_TAKEOFF: lambda a: _nan_or(a.z, lambda z: abs(z) < 20_000.0),
    mav.MAV_CMD_DO_REPOSITION: lambda a: (
        _nan_or(a.p1, lambda v: v in (-1.0, 0.0) or _speed(v))
        and _nan_or(a.p2, _one_of(0.0, 1.0))
        and _nan_or(a.p4, lambda yaw: abs(yaw) <= 4.0 * pi)
        and _place(a)
    ),
    mav.MAV_CMD_DO_ORBIT: lambda a: (
        _nan_or(a.p1, lambda r: 1.0 <= abs(r) <= 1e5)
        and _nan_or(a.p2, lambda v: _speed(abs(v)))
        and _nan_or(a.p3, _whole(0, 5))
        and _place(a)
    ),
    mav.MAV_CMD_DO_CHANGE_SPEED: lambda a: _nan_or(a.p1, _one_of(0.0, 1.0)) and (a.p2 in (-1.0, -2.0) or _speed(a.p2)),
    mav.MAV_CMD_DO_SET_HOME: lambda a: a.p1 == 1.0 or (is_on_earth(a.x, a.y) and isfinite(a.z)),
    mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN: lambda a: is_on_earth(a.x, a.y) and abs(a.z) <= 20_000.0,
    mav.MAV_CMD_DO_FLIGHTTERMINATION: lambda a: a.p1 == 1.0,
    mav.MAV_CMD_CONDITION_YAW: lambda a: abs(a.p1) <= 360.0 and _nan_or(a.p3, _one_of(-1.0, 0.0, 1.0)),
    mav.MAV_CMD_DO_PAUSE_CONTINUE: lambda a: a.p1 in (0.0, 1.0),
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: lambda a: a.p1 in (1.0, 2.0),
    mav.MAV_CMD_PREFLIGHT_STORAGE: lambda a: a.p1 in (0.0, 1.0, 2.0),
    mav.MAV_CMD_PREFLIGHT_CALIBRATION: lambda a: all(_nan_or(p, _one_of(0.0, 1.0, 2.0)) for p in a),
    mav.MAV_CMD_INJECT_FAILURE: lambda a: _whole(0, 255)(a.p1) and _whole(0, 255)(a.p2),
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: lambda a: _whole(0, 2**24)(a.p1) and not isnan(a.p2),
    mav.MAV_CMD_GET_MESSAGE_INTERVAL: lambda a: _whole(0, 2**24)(a.p1),
    mav.MAV_CMD_REQUEST_MESSAGE: lambda a: _whole(0, 2**24)(a.p1),
    mav.MAV_CMD_DO_SET_MISSION_CURRENT: lambda a: _whole(-1, 65535)(a.p1) and _nan_or(a.p2, _one_of(0.0, 1.0)),
    mav.MAV_CMD_DO_SET_STANDARD_MODE: lambda a: _whole(1, 8)(a.p1),
}
"""By MAV_CMD: whether such parameters make sense."""
HARMLESS: tuple[int, ...] = (
    mav.MAV_CMD_NAV_LAND,
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mav.MAV_CMD_NAV_LOITER_UNLIM,
    mav.MAV_CMD_MISSION_START,
    mav.MAV_CMD_RUN_PREARM_CHECKS,
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    mav.MAV_CMD_REQUEST_PROTOCOL_VERSION,
    mav.MAV_CMD_REQUEST_CAMERA_INFORMATION,
)
COMMANDS: tuple[int, ...] = (*SENSIBLE, *HARMLESS)


VEHICLE = (1, 1)
SOURCES = ((255, 190), (245, 190), (255, 0), (1, 191), (2, 1), (0, 0), VEHICLE)
_COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
_STRANGE = (nan, inf, -inf, 3.4e38, -3.4e38, 1e-45, -0.0, 1e9, -1e9)
_USUAL = (0.0, 1.0, -1.0, 2.0, 0.5, 5.0, 21196.0, nan)
_BITS = {"uint8_t": 8, "int8_t": 8, "uint16_t": 16, "int16_t": 16, "uint32_t": 32, "int32_t": 32}
_BITS |= {"uint64_t": 64, "int64_t": 64}
_SETPOINT_MASKS = (0x9F8, 0x9C7, 0x9C0, 0x800, 0xC3F, 0x5C7, 0x0, 0xFFF)
_OFTEN = (
    *("COMMAND_LONG", "COMMAND_INT", "COMMAND_LONG", "COMMAND_INT", "COMMAND_CANCEL", "SET_MODE"),
    *("PARAM_SET", "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST", "MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE"),
    *("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET", "FOLLOW_TARGET"),
    *("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM", "MISSION_REQUEST_INT", "MISSION_SET_CURRENT"),
    *("MISSION_CLEAR_ALL", "MISSION_ACK", "FILE_TRANSFER_PROTOCOL", "LOG_REQUEST_DATA", "SERIAL_CONTROL"),
    *("SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "TIMESYNC", "PING", "HEARTBEAT", "REQUEST_DATA_STREAM"),
)


class _Field(NamedTuple):
    name: str
    kind: str
    length: int


class Sent(NamedTuple):
    """A message on its way, with its claimed source."""

    name: str
    source: tuple[int, int]
    fields: dict[str, Any]
    frame: bytes

    @property
    def wants_answer(self) -> bool:
        if self.name not in _COMMANDS or self.source == VEHICLE:
            return False
        return self.fields["target_system"] in (0, VEHICLE[0]) and self.fields["target_component"] in (0, VEHICLE[1])


class Messages:
    def __init__(self, chance: random.Random, parameters: Sequence[str], commands: Sequence[int]) -> None:
        self.chance = chance
        self.parameters = tuple(parameters)
        self.commands = tuple(commands)
        self._layouts = {mav.mavlink_map[number].msgname: _layout(number) for number in sorted(mav.mavlink_map)}
        self._names = tuple(self._layouts)
        self._wild = True
        self._codecs = {source: Codec(*source) for source in SOURCES}
        self._special: dict[str, Callable[[], Any]] = {
            "target_system": lambda: self._pick((1, 1, 1, 1, 1, 0, 2, 255)),
            "target_component": lambda: self._pick((1, 1, 1, 1, 1, 0, 0, 2, 190)),
            "target": lambda: self._pick((1, 1, 0, 2)),
            "command": self._command,
            "param_id": lambda: self._pick((*self.parameters, "NONE", "", "\x00\xff")).encode("latin-1"),
            "mission_type": lambda: self._pick((0, 0, 0, 1, 2, 3, 255)),
            "count": lambda: self._pick((0, 1, 2, 5, 500, 65535)),
            "seq": lambda: self._pick((0, 1, 2, 3, 500, 65535)),
            "frame": lambda: self._pick((0, 3, 5, 6, 2, 1, 7, 8, 12, 20, 255)),
            "coordinate_frame": lambda: self._pick((1, 1, 8, 5, 6, 7, 9, 11, 12, 20, 0, 255)),
            "type_mask": lambda: self._pick((*_SETPOINT_MASKS, 7, 0x80, chance.getrandbits(8))),
            "q": self._quaternion,
            "custom_mode": lambda: self._pick((*map(custom_mode, Mode), 0, chance.getrandbits(32))),
            "est_capabilities": lambda: self._pick((1, 3, 15, 0, 255)),
        }

    def any(self) -> Sent:
        return self.of(self._pick(_OFTEN) if self.chance.random() < 0.8 else self._pick(self._names))

    def of(self, name: str) -> Sent:
        layout = self._layouts[name]
        self._wild = self.chance.random() < 0.6
        fields = {field.name: self._field(field) for field in layout}
        if name == "COMMAND_INT" or name.startswith("MISSION_ITEM") or "lat_int" in fields:
            self._near(fields, in_degrees=name == "MISSION_ITEM")
        if name == "PARAM_SET" and self.chance.random() < 0.5:
            fields["param_type"] = self._pick((6, 9))
        if name == "FILE_TRANSFER_PROTOCOL":
            fields["payload"] = self._file_request()
        return self.sent(name, self._pick(SOURCES), fields)

    def sent(self, name: str, source: tuple[int, int], fields: dict[str, Any]) -> Sent:
        return Sent(name, source, fields, self._codecs[source].encode(name, *fields.values()))

    def _near(self, fields: dict[str, Any], *, in_degrees: bool) -> None:
        chance = self.chance
        if chance.random() < 0.3:
            return
        scale = 1.0 if in_degrees else 1e7
        x, y = ("lat_int", "lon_int") if "lat_int" in fields else ("x", "y")
        fields[x] = scale * (DEFAULT_ORIGIN.latitude_deg + chance.uniform(-2e-4, 2e-4))
        fields[y] = scale * (DEFAULT_ORIGIN.longitude_deg + chance.uniform(-2e-4, 2e-4))
        if not in_degrees:
            fields[x], fields[y] = round(fields[x]), round(fields[y])
        height = "alt" if "lat_int" in fields else "z"
        fields[height] = chance.choice((DEFAULT_ORIGIN.altitude_m, 0.0)) + chance.uniform(1.0, 20.0)

    def _field(self, field: _Field) -> Any:
        special = self._special.get(field.name)
        if special is not None and field.length in (0, 4, 16):
            value = special()
            return _fitting(value, field.kind) if isinstance(value, int) else value
        if field.kind == "char":
            return self.chance.randbytes(self.chance.randrange(max(field.length, 1) + 1)) or b"\x00"
        if field.length:
            return [self._number(field.kind) for _ in range(field.length)]
        return self._number(field.kind)

    def _number(self, kind: str) -> Any:
        chance = self.chance
        if kind in ("float", "double"):
            return self._real()
        bits = _BITS[kind]
        value = chance.choice((0, 0, 1, 2, 3, chance.getrandbits(3), chance.getrandbits(10), chance.getrandbits(bits)))
        value = chance.choice((value, value, value, 2**bits - 1, 2 ** (bits - 1), 2 ** (bits - 1) - 1))
        return _fitting(value, kind)

    def _real(self) -> float:
        chance = self.chance
        kind = chance.randrange(5)
        if kind < 2 or (not self._wild and kind < 4):
            return chance.choice(_USUAL)
        if kind == 2 or not self._wild:
            return chance.uniform(-20.0, 20.0)
        if kind == 3:
            return chance.choice(_STRANGE)
        value: float = struct.unpack("<f", chance.randbytes(4))[0]
        return value

    def _command(self) -> int:
        chance = self.chance
        known = chance.random() < 0.8
        return chance.choice(self.commands) if known else chance.choice((chance.getrandbits(9), chance.getrandbits(16)))

    def _quaternion(self) -> list[float]:
        whole = ((1.0, 0.0, 0.0, 0.0), (0.7071068, 0.0, 0.0, 0.7071068), (0.0, 1.0, 0.0, 0.0))
        return list(self._pick(whole)) if self.chance.random() < 0.6 else [self._real() for _ in range(4)]

    def _file_request(self) -> bytes:
        chance = self.chance
        name = chance.choice(
            (b"/", b"logs", b"/logs/a.tlog", b"@PARAM/param.pck", b"../../etc/passwd", b"a" * 239, b"")
        )
        size = chance.choice((len(name), 0, 239, 255, chance.randrange(256)))
        head = (chance.getrandbits(16), chance.randrange(4), chance.randrange(20), size, 0, 0, 0)
        packed = struct.pack("<HBBBBBBI", *head, chance.choice((0, 1, 239, 2**31, 2**32 - 1)))
        return (packed + name).ljust(251, b"\0")[:251]

    def _pick(self, choices: Sequence[Any]) -> Any:
        return self.chance.choice(choices)


def _fitting(value: int, kind: str) -> float:
    if kind in ("float", "double"):
        return float(value)
    bits = _BITS[kind]
    value %= 2**bits
    return value - 2**bits if kind.startswith("int") and value >= 2 ** (bits - 1) else value


def _layout(number: int) -> tuple[_Field, ...]:
    definition = mav.mavlink_map[number]
    lengths = dict(zip(definition.ordered_fieldnames, definition.array_lengths, strict=True))
    kinds = zip(definition.fieldnames, definition.fieldtypes, strict=True)
    fields = [_Field(name, kind, lengths[name]) for name, kind in kinds]
    later = [_Field(name, "uint32_t", 0) for name in LATER.get(definition.msgname, ()) if name not in lengths]
    return (*fields, *later)
