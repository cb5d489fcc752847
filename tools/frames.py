"""`python -m tools.frames`: the longest frame of each request, in ms of work."""

import argparse
import random
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing
from math import cos, nan, pi, sin
from pathlib import Path
from struct import pack
from tempfile import TemporaryDirectory

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.autopilot.parameters.behaviour import TRACKS
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.process.lifecycle import gc_frozen, loading, use_one_thread
from colibri.mavlink.client.commands import padded
from colibri.mavlink.files.folder import Folder
from colibri.mavlink.mission.items import FENCE, MISSION, MissionItem
from colibri.mavlink.parameters.store import Parameter, ParamType, bits_of
from colibri.mavlink.telemetry.table import telemetry
from colibri.mavlink.wire.dialect import Bits, Codec, mav
from colibri.sitl.ground_station import Station
from colibri.sitl.mission_items import on_wire, polygon, waypoint
from colibri.sitl.vehicle import FORCE
from tools.fuzz.messages import COMMANDS, Messages
from tools.fuzz.vehicle import COMPONENT, HIGH, SYSTEM, BareFlight
from tools.harness.frame_times import FrameTimes

TO = (SYSTEM, COMPONENT)
STATIONS = 32
ITEMS, TRIANGLES = 900, 330
FRAMES_BETWEEN = 30
_LIST, _OPEN, _BURST, _CHECKSUM, _CREATE = 3, 4, 15, 14, 6
_CODEC = Codec(255, 190)

Request = Callable[[BareFlight], Iterator[list[bytes]]]
"""Yields the messages of each frame, at most 4 kB."""


def mission() -> list[MissionItem]:
    return on_wire((waypoint(50.0 * cos(i), 50.0 * sin(i), 10.0) for i in range(ITEMS)), DEFAULT_ORIGIN)


def fence() -> list[MissionItem]:
    """Return exclusion triangles on a circle of 500 m."""
    angles = (2 * pi * i / TRIANGLES for i in range(TRIANGLES))
    corners = ([(x, y), (x + 1.0, y), (x, y + 1.0)] for x, y in ((500.0 * cos(at), 500.0 * sin(at)) for at in angles))
    return on_wire((item for triangle in corners for item in polygon(triangle, keep_out=True)), DEFAULT_ORIGIN)


def load(flight: BareFlight) -> None:
    flight.copter.stations.plans.load(FENCE, fence())
    flight.copter.stations.plans.load(MISSION, mission())


def command(number: int, *params: float) -> bytes:
    return _CODEC.encode("COMMAND_LONG", *TO, number, 0, *padded(params, 7))


def mode_command(mode: Mode) -> bytes:
    number = custom_mode(mode)
    return command(mav.MAV_CMD_DO_SET_MODE, 1.0, number >> 16 & 0xFF, number >> 24)


def sets(parameter: Parameter, share: float) -> bytes:
    """Set a parameter off its default by a share, or to another value."""
    default = parameter.default
    value = default * (1.0 + share) if isinstance(default, float) else default + 1
    value = min(max(value, parameter.minimum), parameter.maximum)
    if parameter.kind == ParamType.INT:
        value = int(value)
    bits = Bits(bits_of(parameter.kind, value))
    return _CODEC.encode("PARAM_SET", *TO, parameter.name.encode(), bits, parameter.kind)


def file(opcode: int, path: bytes = b"/", *, session: int = 0) -> bytes:
    payload = pack("<HBBBBBBI", 0, session, opcode, len(path), 0, 0, 0, 0) + path
    return _CODEC.encode("FILE_TRANSFER_PROTOCOL", 0, *TO, payload.ljust(251, b"\0"))


def _repeated(name: str, *fields: object, count: int) -> Request:
    return lambda _flight: iter([[_CODEC.encode(name, *fields) for _ in range(count)]])


def _planned(request: Request) -> Request:
    def planned(flight: BareFlight) -> Iterator[list[bytes]]:
        load(flight)
        yield []
        yield from request(flight)

    return planned


def _commands(number: int, *params: float, count: int = 80) -> Request:
    return _planned(
        lambda _flight: iter([[command(number, *params[:-1], params[-1] + 1e-3 * i) for i in range(count)]])
    )


def _parameters(*prefixes: str) -> Request:
    def request(flight: BareFlight) -> Iterator[list[bytes]]:
        chosen = [p for p in flight.copter.parameters if p.name.startswith(prefixes) and not p.read_only]
        for share in (0.001, 0.002):
            yield [sets(chosen[i % len(chosen)], share * (1 + i // len(chosen))) for i in range(120)]

    return request


def _each_parameter(flight: BareFlight) -> Iterator[list[bytes]]:
    for parameter in flight.copter.parameters:
        yield [sets(parameter, 0.001)]


def _upload(plan_type: int, items: list[MissionItem], first: Mapping[int, list[MissionItem]]) -> Request:
    def request(flight: BareFlight) -> Iterator[list[bytes]]:
        for kind, plan in first.items():
            flight.copter.stations.plans.load(kind, plan)
        yield [_CODEC.encode("MISSION_COUNT", *TO, len(items), plan_type)]
        for at in range(0, len(items), 60):
            whole = list(enumerate(items))[at : at + 60]
            yield [_CODEC.encode("MISSION_ITEM_INT", *TO, i, *each[:2], 0, *each[2:], plan_type) for i, each in whole]

    return request


def _file_requests(opcode: int, path: bytes, count: int) -> Request:
    return lambda _flight: iter([[file(opcode, path, session=i) for i in range(count)]])


def _bursts(_flight: BareFlight) -> Iterator[list[bytes]]:
    yield [file(_OPEN, b"/big", session=i) for i in range(8)]
    yield [file(_BURST, session=i) for i in range(8)]


def _others(flight: BareFlight) -> list[Station]:
    return [flight.add(Station, 255) for _ in range(STATIONS - 1)]


def _streams(flight: BareFlight) -> Iterator[list[bytes]]:
    names = telemetry(0)
    for client in _others(flight):
        for name in names:
            number = getattr(mav, f"MAVLINK_MSG_ID_{name}", 0)
            client.send_raw(command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 4000.0))
    yield []


def _lists(flight: BareFlight) -> Iterator[list[bytes]]:
    for client in _others(flight):
        client.send("PARAM_REQUEST_LIST", *TO)
        client.send("LOG_REQUEST_LIST", *TO, 0, 0xFFFF)
    yield []


def _broadcast(flight: BareFlight) -> Iterator[list[bytes]]:
    _others(flight)
    yield from _parameters("MPC", "MIS", "NAV")(flight)


def _forwarded(flight: BareFlight) -> Iterator[list[bytes]]:
    _others(flight)
    yield [_CODEC.encode("PING", 0, i, 0, 0) for i in range(120)]


def _tracks(_flight: BareFlight) -> Iterator[list[bytes]]:
    for index, _ in enumerate(TRACKS):
        yield [_CODEC.encode("PARAM_SET", *TO, b"TRACK", Bits(index), ParamType.INT), mode_command(Mode.TRACK)]
        yield []
        yield [command(mav.MAV_CMD_NAV_LOITER_UNLIM)]


def _modes(_flight: BareFlight) -> Iterator[list[bytes]]:
    yield [mode_command(mode) for mode in (Mode.TRACK, Mode.HOLD)] * 40


def _reset(flight: BareFlight) -> Iterator[list[bytes]]:
    changed = [parameter for parameter in flight.copter.parameters if parameter.name.startswith(("LPV", "VEH", "MPC"))]
    for at in range(0, len(changed), 40):
        yield [sets(parameter, 0.001) for parameter in changed[at : at + 40] if not parameter.read_only]
    yield from [[]] * FRAMES_BETWEEN
    flight.copter.pilot.disarm(force=True)
    yield [command(mav.MAV_CMD_PREFLIGHT_STORAGE, 2.0)]


def _garbage(byte: bytes) -> Request:
    return lambda _flight: iter([[byte * 4096]] * 2)


def _old_frames(_flight: BareFlight) -> Iterator[list[bytes]]:
    sender = mav.MAVLink(None, srcSystem=255, srcComponent=190)
    heartbeat = mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(sender, force_mavlink1=True)
    yield [bytes(heartbeat)] * (4096 // len(heartbeat))


_SHELL = b"param\n" * 11
REQUESTS: Mapping[str, Request] = {
    "120 parameters of the law": _parameters("LPV"),
    "120 parameters of the vehicle": _parameters("VEH"),
    "120 parameters of the behaviour": _parameters("MPC", "MIS", "NAV"),
    "120 parameters of failsafes": _parameters("COM", "BAT", "GF"),
    "120 parameters, 32 stations": _broadcast,
    "each parameter alone": _each_parameter,
    "reset of all parameters": _reset,
    "lists of parameters and logs, 32 stations": _lists,
    "mission of 900 items": _upload(MISSION, mission(), {FENCE: fence()}),
    "fence of 330 triangles": _upload(FENCE, fence(), {MISSION: mission()}),
    "80 orbits": _commands(mav.MAV_CMD_DO_ORBIT, 5.0, 2.0, 0.0, 0.0, nan, nan, nan),
    "80 new homes": _commands(mav.MAV_CMD_DO_SET_HOME, 1.0, 0.0),
    "100 new origins": _planned(_repeated("SET_GPS_GLOBAL_ORIGIN", SYSTEM, 473977420, 85455940, 488000, 0, count=100)),
    "80 plans cleared": _planned(_repeated("MISSION_CLEAR_ALL", *TO, 255, count=80)),
    "100 fences cleared": _planned(_repeated("MISSION_CLEAR_ALL", *TO, FENCE, count=100)),
    "120 mission items read": _planned(_repeated("MISSION_REQUEST_INT", *TO, 5, 0, count=120)),
    "130 turns of the mission": _planned(_repeated("MISSION_SET_CURRENT", *TO, 3, count=130)),
    "15 listings of 1000 files": _file_requests(_LIST, b"/", 15),
    "15 checksums of 8 MB": _file_requests(_CHECKSUM, b"/big", 15),
    "15 packed parameter files": _file_requests(_OPEN, b"@PARAM/param.pck", 15),
    "15 new files": _file_requests(_CREATE, b"/new", 15),
    "8 bursts": _bursts,
    "200 lists of logs": _repeated("LOG_REQUEST_LIST", *TO, 0, 0xFFFF, count=200),
    "all logs erased": _repeated("LOG_ERASE", *TO, count=200),
    "15 listings of generated files": _file_requests(_LIST, b"/@PARAM", 15),
    "15 paths of 16 folders": _file_requests(_OPEN, b"/" + b"folder/" * 15 + b"file", 15),
    "15 logs of 8 MB": _repeated("LOG_REQUEST_DATA", *TO, 0, 0, 0xFFFFFFFF, count=120),
    "120 downloads of the mission": _planned(_repeated("MISSION_REQUEST_LIST", *TO, 0, count=120)),
    "120 parameters read": _repeated("PARAM_REQUEST_READ", *TO, b"VEH_MASS", -1, count=120),
    "60 setpoints": _repeated(
        "SET_POSITION_TARGET_LOCAL_NED", 0, *TO, 1, 0xDF8, *(1.0, 0.0, -10.0), *(0.0,) * 8, count=60
    ),
    "70 setpoints of attitude": _repeated(
        "SET_ATTITUDE_TARGET", 0, *TO, 7, [1.0] + [0.0] * 3, *(0.0,) * 3, 0.5, count=70
    ),
    "150 sticks": _repeated("MANUAL_CONTROL", SYSTEM, 100, 100, 500, 0, 0, count=150),
    "80 gotos": _commands(mav.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, nan, nan, nan, 10.0),
    "80 take-offs": _commands(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, 10.0),
    "80 returns": _commands(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0),
    "80 starts of the mission": _commands(mav.MAV_CMD_MISSION_START, 0.0, 0.0),
    "80 failures": _commands(mav.MAV_CMD_INJECT_FAILURE, 0.0, 1.0, 0.0),
    "80 calibrations": _commands(mav.MAV_CMD_PREFLIGHT_CALIBRATION, 1.0, 0.0),
    "120 times": _repeated("TIMESYNC", 0, 1, count=120),
    "50 lines of the shell": _repeated("SERIAL_CONTROL", 10, 6, 0, 0, 66, _SHELL.ljust(70, b"\0"), count=45),
    "32 stations at 250 Hz": _streams,
    "200 groups of streams": lambda _flight: iter(
        [[_CODEC.encode("REQUEST_DATA_STREAM", *TO, 0, 1 + i % 50, 1) for i in range(200)]]
    ),
    "120 pings to 32 stations": _forwarded,
    "120 requests of messages": _commands(
        mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AVAILABLE_MODES, 0.0, count=95
    ),
    "each track": _tracks,
    "80 changes of mode": _modes,
    "300 heartbeats": _repeated("HEARTBEAT", 6, 8, 0, 0, 4, 3, count=190),
    "4 kB of markers": _garbage(b"\xfd"),
    "4 kB of old markers": _garbage(b"\xfe"),
    "4 kB of noise": _garbage(b"\x00"),
    "4 kB of MAVLink 1": _old_frames,
}


def in_the_air(flight: BareFlight) -> None:
    flight.reset_world(HIGH)
    flight.copter.pilot.ground.take_off(0)
    flight.client.order(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, FORCE)
    flight.run(0.2)


FRAMES_AFTER = 60
MOST_BYTES = 4096  # what a link receives at once
FILES = 999


def fly_frame(flight: BareFlight, messages: list[bytes]) -> None:
    while sum(map(len, messages)) > MOST_BYTES:
        messages.pop()
    if messages:
        flight.client.send_raw(b"".join(messages))
    flight.step()


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.frames", description=__doc__)
    parser.add_argument("only", nargs="*", help="parts of names of requests")
    parser.add_argument("--random", type=int, default=10_000, help="random messages, 40 a frame")
    parser.add_argument("--repeat", type=int, default=2, help="of which the quickest counts")
    args = parser.parse_args()
    use_one_thread()
    print(f"{'request':45} {'worst frame':>11} {'in all':>9}   ms of work")
    worst = 0.0
    for name, request in REQUESTS.items():
        if not args.only or any(part in name for part in args.only):
            times = min(_times(request, loading, FRAMES_AFTER) for _ in range(args.repeat))
            worst = max(worst, times[0])
            _print(name, *times)
    if args.random and not args.only:
        times = _times(_random(args.random), gc_frozen)  # as processes fly
        _print(f"{args.random} random messages", *times)
        worst = max(worst, times[0])
    _print("worst", worst, 0.0)
    return 0


def _print(name: str, worst_ms: float, total_ms: float) -> None:
    print(f"{name:45} {worst_ms:11.2f} {total_ms:9.1f}", flush=True)


def _times(
    request: Request, garbage: Callable[[], AbstractContextManager[None]], frames_after: int = 0
) -> tuple[float, float]:
    """Return the longest frame and all frames, ms of work."""
    with TemporaryDirectory() as folder, closing(_files(Path(folder))) as files:
        flight = BareFlight(files=files)
        in_the_air(flight)
        flight.run(0.3)
        frames_s = FrameTimes(flight.autopilot)
        with garbage():
            for messages in request(flight):
                fly_frame(flight, list(messages))
            for _ in range(frames_after):
                flight.step()
    return 1e3 * max(frames_s), 1e3 * sum(frames_s)


def _random(count: int) -> Request:
    def request(flight: BareFlight) -> Iterator[list[bytes]]:
        names = [parameter.name for parameter in flight.copter.parameters]
        messages = Messages(random.Random(1), names, COMMANDS)
        for _ in range(count // 40):
            yield [messages.any().frame for _ in range(40)]

    return request


def _files(folder: Path) -> Folder:
    for name in ("file", "logs/log"):
        (folder / name).parent.mkdir(exist_ok=True)
        for number in range(FILES):
            (folder / f"{name}{number:04}").touch()
    (folder / "big").write_bytes(bytes(8 << 20))
    return Folder(folder)


if __name__ == "__main__":
    sys.exit(main())
