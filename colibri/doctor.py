"""`colibri doctor`: the checks, and their findings as a table."""

import argparse
import os
import platform
import re
import socket
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from enum import StrEnum
from functools import partial
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, TypeAlias

import psutil
from packaging.requirements import Requirement

import colibri
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, one_line
from colibri.common.types import Address
from colibri.flights.fleet_spec import GROUND_PORT, PLANT_PORT, SDK_PORT
from colibri.mavlink.links.link import GroundLink
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import Codec, mav


class Severity(StrEnum):
    FINE = "fine"
    NOTE = "note"  # flights work, with a remark
    FAILED = "failed"  # flights cannot work, or not with a ground station


class Finding(NamedTuple):
    """What a check has found, with advice unless all is well."""

    checked: str
    verdict: Severity
    found: str
    advice: str = ""


PACKAGE = "colibri-sitl"
FOR_DEVELOPERS = ("bench", "clients", "dev")  # extras that only a clone can use
_LOCK = "requirements.lock"
_PINNED = re.compile(r"^[\w.-]+==[^\\\n]+", re.MULTILINE)
_SHOWN = 3


def python() -> Finding:
    return Finding("Python", Severity.FINE, f"{platform.python_version()}, {sys.executable}")


def packages() -> Finding:
    wrong = [words for asked in _asked() if (words := _wrong(asked))]
    if wrong:
        return Finding("packages", Severity.FAILED, ", ".join(wrong), f"pip install --upgrade {PACKAGE}")
    return Finding("packages", Severity.FINE, f"{PACKAGE} {version(PACKAGE)} and the {len(_asked())} that it needs")


def lock() -> Finding | None:
    """Compare versions with the lock, which exists only in a checkout."""
    path = Path(colibri.__file__).resolve().parents[1] / _LOCK
    if not path.is_file():
        return None
    pinned = _here(map(Requirement, _PINNED.findall(path.read_text(encoding="utf-8"))))
    others = [words for pin in pinned if version_of(pin.name) is not None and (words := _wrong(pin))]
    if others:
        said = ", ".join(others[:_SHOWN]) + (f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else "")
        return Finding("lock", Severity.NOTE, said, "make clean setup: as they were tested")
    return Finding("lock", Severity.FINE, f"no other version than {_LOCK} names")


def extras() -> Iterator[Finding]:
    for extra in distribution(PACKAGE).metadata.get_all("Provides-Extra") or []:
        if extra in FOR_DEVELOPERS:
            continue
        missing = [asked.name for asked in _asked(extra) if _wrong(asked)]
        if missing:
            advice = f"if you need it: pip install '{PACKAGE}[{extra}]'"
            yield Finding(f"extra {extra}", Severity.NOTE, f"without {', '.join(missing)}", advice)
        else:
            yield Finding(f"extra {extra}", Severity.FINE, "installed")


def _asked(extra: str = "") -> list[Requirement]:
    every = [Requirement(line) for line in distribution(PACKAGE).requires or []]
    always = _here(every)
    return [asked for asked in _here(every, extra) if asked not in always] if extra else always


def _here(every: Iterable[Requirement], extra: str = "") -> list[Requirement]:
    return [asked for asked in every if asked.marker is None or asked.marker.evaluate({"extra": extra})]


def _wrong(asked: Requirement) -> str:
    has = version_of(asked.name)
    if has is None:
        return f"{asked.name} is missing"
    return "" if asked.specifier.contains(has, prereleases=True) else f"{asked.name} is {has}, not {asked.specifier}"


def version_of(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


_TRACK, _DURATION_S = "hover", 2.0
_CPU_INFO = Path("/proc/cpuinfo")


def machine_code() -> Finding:
    from colibri.common.machine_code.on_disk import folder_to_write

    folder = folder_to_write()
    if folder is None:
        advice = "name a folder: NUMBA_CACHE_DIR=FOLDER"
        return Finding("machine code", Severity.NOTE, "cannot be cached: each start compiles again", advice)
    return Finding("machine code", Severity.FINE, f"kept in {folder}")


def flight() -> Finding:
    """Measure the speed of two processes over loopback, without compilation."""
    from colibri.experiments.flight import fly

    try:
        flown = fly(_TRACK, link="udp", duration=_DURATION_S)
    except Error as error:
        return Finding("flight", Severity.FAILED, str(error), "for details: colibri fly hover")
    times = flown.report["real_time_factor"]
    return Finding("flight", Severity.FINE, f"{times:.0f} times real time, on {os.cpu_count()} cores: {processor()}")


def processor() -> str:
    if _CPU_INFO.exists():
        for line in _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


HOST = "127.0.0.1"
WITHIN_S = 1.0
_ROUTES = Path("/proc/net/route")
_CONTAINERS = (Path("/.dockerenv"), Path("/run/.containerenv"))


def loopback() -> Finding:
    with _udp() as here, _udp() as there:
        try:
            there.bind((HOST, 0))
            there.settimeout(WITHIN_S)
            here.sendto(b"colibri", there.getsockname())
            there.recv(16)
        except OSError as error:
            why = str(error) or type(error).__name__
            return Finding("loopback", Severity.FAILED, f"UDP over {HOST}: {why}", "bring it up: ip link set lo up")
    return Finding("loopback", Severity.FINE, f"UDP over {HOST} arrives")


def ports() -> Iterator[Finding]:
    for port, whose in ((GROUND_PORT, "ground station"), (SDK_PORT, "SDK"), (PLANT_PORT, "plant")):
        who, ours, checked = _who_has(port), whose == "plant", f"port {port}, {whose}"
        if who is None:
            yield Finding(checked, Severity.FINE, "free" if ours else "free: start the program at any time")
        elif ours:
            yield Finding(checked, Severity.FAILED, f"taken by {who}", "end that, or colibri sitl --plant-port 0")
        else:
            yield Finding(checked, Severity.FINE, f"{who} is listening: the autopilot will connect")


def beyond() -> Finding | None:
    """Return the host's address, from a container or WSL."""
    what = "WSL" if _in_wsl() else "container" if any(path.exists() for path in _CONTAINERS) else None
    if what is None:
        return None
    host = gateway(_ROUTES.read_text(encoding="ascii")) if _ROUTES.exists() else None
    if host is None:
        return Finding(what, Severity.NOTE, "no way out of it", "run the ground station here, too")
    advice = f"colibri sitl --gcs udpout:{host}:{GROUND_PORT} --signing-key FILE (or --insecure)"
    return Finding(what, Severity.NOTE, f"a ground station on the host is at {host}", advice)


def gateway(routes: str) -> str | None:
    """Read the default gateway from the text of `/proc/net/route`."""
    for line in routes.splitlines()[1:]:
        _, destination, through, *_ = line.split()
        if int(destination, 16) == 0 and int(through, 16):
            return socket.inet_ntoa(int(through, 16).to_bytes(4, "little"))
    return None


def _udp() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)


def _in_wsl() -> bool:
    return "microsoft" in os.uname().release.lower() if hasattr(os, "uname") else False


def _who_has(port: int) -> str | None:
    with _udp() as tried:
        try:
            tried.bind((HOST, port))
        except OSError:
            return _program(port)
    return None


def _program(port: int) -> str:
    try:
        found = [it.pid for it in psutil.net_connections("udp4") if it.laddr and it.laddr.port == port and it.pid]
        return f"{psutil.Process(found[0]).name()} (process {found[0]})" if found else "another program"
    except (psutil.Error, OSError):  # what belongs to others may not be looked at
        return "another program"


_EVERY_S = 1.0
_STATIONS: Sequence[int] = (mav.MAV_TYPE_GCS, mav.MAV_TYPE_ONBOARD_CONTROLLER)


def ground_station(link: GroundLink, within_s: float) -> Finding:
    answers = called(link, within_s)
    if answers is not None:
        return Finding("ground station", Severity.FINE, answers)
    said = f"no heartbeat over {link.url} within {within_s:g} s"
    return Finding("ground station", Severity.FAILED, said, f"start it; have it listen on UDP port {GROUND_PORT}")


def called(link: GroundLink, within_s: float) -> str | None:
    codec = Codec(1, mav.MAV_COMP_ID_AUTOPILOT1)
    beat = (mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_GENERIC, 0, 0, mav.MAV_STATE_STANDBY, 3)
    stations: set[Address] = set()
    began_s = now_s = beat_at_s = perf_counter()
    while now_s < began_s + within_s:
        stations.update(link.take_opened())
        if now_s >= beat_at_s:
            beat_at_s += _EVERY_S
            for address in stations:
                link.send(codec.encode("HEARTBEAT", *beat), address)
        link.wait(min(beat_at_s, began_s + within_s) - now_s)
        for datagram, (host, port) in link.receive_now():
            stations.add((host, port))
            for it in codec.decode(datagram):
                if it.name == "HEARTBEAT" and it.fields.type in _STATIONS:
                    return f"system {it.source[0]} at {host}:{port} answers"
        now_s = perf_counter()
    return None


Check: TypeAlias = Callable[[], Finding | Iterable[Finding] | None]

CHECKS: tuple[Check, ...] = (python, packages, lock, machine_code, loopback, ports, beyond, flight, extras)  # in order
_COLORS = {Severity.FINE: "green", Severity.NOTE: "yellow", Severity.FAILED: "bold red"}


def examine(checks: Iterable[Check] = CHECKS) -> Iterator[Finding]:
    for check in checks:
        found = check()
        if isinstance(found, Finding):
            yield found
        elif found is not None:
            yield from found


def doctor(args: argparse.Namespace) -> int:
    failed = 0
    with one_line(), ExitStack() as held:
        asked: list[Check] = []
        if args.gcs is not None:
            asked.append(partial(ground_station, held.enter_context(closing(open_ground_link(args.gcs))), args.within))
        for finding in examine([*CHECKS, *asked]):
            failed += finding.verdict is Severity.FAILED
            show(finding)
    return EXIT_FAILED if failed else 0


def show(finding: Finding) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 2))
    for width in (6, 26):
        table.add_column(width=width, no_wrap=True)
    table.add_column()
    table.add_row(Text(finding.verdict, _COLORS[finding.verdict]), Text(finding.checked), Text(finding.found))
    if finding.advice:
        table.add_row("", "", Text(f"→ {finding.advice}"))
    Console().print(table)
