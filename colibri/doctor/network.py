"""Check loopback, ports, and the host of a container or WSL."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import psutil

from colibri.doctor.finding import Finding, Severity
from colibri.flights.fleet_spec import GROUND_PORT, PLANT_PORT, SDK_PORT

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
    for port, whose, ours in (
        (GROUND_PORT, "ground station", False),
        (SDK_PORT, "SDK", False),
        (PLANT_PORT, "plant", True),
    ):
        who = _who_has(port)
        checked = f"port {port}, {whose}"
        if who is None:
            yield Finding(checked, Severity.FINE, "free" if ours else "free: start the program at any time")
        elif ours:
            advice = "end that, or colibri sitl --plant-port 0"
            yield Finding(checked, Severity.FAILED, f"taken by {who}", advice)
        else:
            yield Finding(checked, Severity.FINE, f"{who} is listening: the autopilot will connect")


def beyond() -> Finding | None:
    """Return the host's address as seen from a container or WSL, if this is one."""
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
