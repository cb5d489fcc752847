"""Endpoints by URL; all raise `LinkError`.

`udpin:HOST:PORT` waits for any sender, `udpout:HOST:PORT` exchanges datagrams with that address only; `tcpin:HOST:PORT`
waits for clients, `tcp:HOST:PORT` calls a server; `serial:DEVICE:BAUD` is a serial port.
"""

import os
import socket
from collections.abc import Iterable
from contextlib import suppress
from ipaddress import ip_address

from colibri.common.types import Address
from colibri.mavlink.links.link import GroundLink, LinkError
from colibri.mavlink.links.serial_port import SerialLink
from colibri.mavlink.links.tcp import TcpClient, TcpServer
from colibri.mavlink.links.udp import UdpLink

_UDP = ("udpin", "udpout")
_TCP = ("tcpin", "tcp")
_SERIAL, _SERIAL_FORM = "serial:", "serial:DEVICE:BAUD"


def open_link(url: str) -> UdpLink:
    return _open_udp(url, *_parse(url, _UDP))


def open_ground_link(url: str) -> GroundLink:
    if is_serial(url):
        return SerialLink(url, *_parse_serial(url))
    scheme, host, port = _parse(url, (*_UDP, *_TCP))
    if scheme in _UDP:
        return _open_udp(url, scheme, host, port)
    address = (_resolved(url, host), port)
    if scheme == "tcp":
        return TcpClient(url, address)
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":  # elsewhere this would let two programs have one port
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    _bind(sock, url, address, listen=True)
    return TcpServer(sock, f"tcpin:{host}:{sock.getsockname()[1]}")


def is_serial(url: str) -> bool:
    return url.startswith(_SERIAL)


def beyond_loopback(url: str) -> bool:
    """Whether an endpoint reaches other computers by a network."""
    if is_serial(url):
        _parse_serial(url)
        return False
    _, host, _ = _parse(url, (*_UDP, *_TCP))
    return not ip_address(_resolved(url, host)).is_loopback


def calls_this_computer(url: str) -> bool:
    """Whether an endpoint has one peer only, on this computer."""
    return url.startswith(("udpout:", "tcp:")) and not beyond_loopback(url)


def check_reach(urls: Iterable[str], *, signed: bool, insecure: bool) -> None:
    """Require a key or `insecure` for each URL that reaches the network."""
    for url in urls:
        if beyond_loopback(url) and not (signed or insecure):
            raise LinkError(unsigned_refusal(url))


def unsigned_refusal(url: str) -> str:
    return f"{url} reaches beyond this computer: give --signing-key FILE, or --insecure to accept commands from anyone"


def _open_udp(url: str, scheme: str, host: str, port: int) -> UdpLink:
    address = (_resolved(url, host), port)
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if scheme == "udpout":
        return UdpLink(sock, url, address)
    _bind(sock, url, address)
    return UdpLink(sock, f"udpin:{host}:{sock.getsockname()[1]}", None)


def _resolved(url: str, host: str) -> str:
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        raise LinkError(f"{url}: unknown host {host}") from error


def _bind(sock: socket.socket, url: str, address: Address, *, listen: bool = False) -> None:
    try:
        if listen or address[1]:
            sock.bind(address)
        else:
            _bind_anywhere(sock, address[0])
        if listen:
            sock.listen()
    except OSError as error:
        sock.close()
        raise LinkError(f"{url}: {error.strerror}; end the program that has this port, or name another") from error


def _bind_anywhere(sock: socket.socket, host: str) -> None:
    """Bind to a free port by its number: Linux takes one of its own choice away when a connection is released."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((host, 0))
            free = probe.getsockname()
        with suppress(OSError):
            sock.bind(free)
            return


def _parse(url: str, schemes: tuple[str, ...]) -> tuple[str, str, int]:
    scheme, _, rest = url.partition(":")
    host, _, port = rest.rpartition(":")
    if scheme not in schemes or not host or not port.isdecimal() or int(port) > 65535:
        forms = [f"{scheme}:HOST:PORT" for scheme in schemes]
        raise LinkError(f"{url}: expected " + " or ".join(forms if schemes == _UDP else [*forms, _SERIAL_FORM]))
    if scheme in ("udpout", "tcp") and int(port) == 0:
        raise LinkError(f"{url}: port 0 is not a port to send to")
    return scheme, host, int(port)


def _parse_serial(url: str) -> tuple[str, int]:
    device, _, baud = url.removeprefix(_SERIAL).rpartition(":")
    if not device or not baud.isdecimal() or int(baud) == 0:
        raise LinkError(f"{url}: expected {_SERIAL_FORM}, for instance serial:/dev/ttyACM0:921600")
    return device, int(baud)
