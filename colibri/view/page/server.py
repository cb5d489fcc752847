"""The server of the page: viser on loopback, with access control and a Content-Security-Policy.

Pages of other sites show in `Origin`, and foreign names that resolve to loopback (DNS rebinding) in `Host`.
"""

import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from io import StringIO
from typing import Any, NamedTuple

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from colibri.view.snapshot import ViewError

HOST = "127.0.0.1"
_TOKEN_BYTES = 12
_OURS = (HOST, "localhost")


class Token(NamedTuple):
    """The secret that a browser needs for commands."""

    text: str

    @classmethod
    def new(cls) -> "Token":
        return cls(secrets.token_urlsafe(_TOKEN_BYTES))

    def matches(self, text: str) -> bool:
        """Compare in constant time."""
        return secrets.compare_digest(self.text.encode(), text.strip().encode())


def refusal(headers: Mapping[str, str], port: int) -> str | None:
    """Return why to refuse a request, if it must be."""
    if headers.get("Host") not in {f"{name}:{port}" for name in _OURS}:
        return "the page is served to this computer alone"
    origin = headers.get("Origin")
    connects = headers.get("Upgrade", "").lower() == "websocket"
    if origin is None:
        return "a connection without an origin is refused" if connects else None
    if origin not in {f"http://{name}:{port}" for name in _OURS}:
        return f"{origin} may not use this page"
    return None


def content_policy(port: int, nonce: str) -> dict[str, str]:
    """Return headers that restrict a browser to the page's own scripts and this server."""
    sources = {
        "default-src": "'none'",
        "script-src": f"'nonce-{nonce}' 'wasm-unsafe-eval'",
        "worker-src": "blob:",
        "connect-src": " ".join(
            ["data: blob:", *(f"{kind}://{name}:{port}" for kind in ("http", "ws") for name in _OURS)]
        ),
        "style-src": "'unsafe-inline'",
        "img-src": "data: blob:",
        "font-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    return {
        "Content-Security-Policy": "; ".join(f"{what} {allowed}" for what, allowed in sources.items()),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
    }


_Answer = Callable[[ServerConnection, Request], Response | None]


class PageServer(viser.ViserServer):
    """viser's server without its public tunnel to this computer."""

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
        return None


def serve(port: int, label: str) -> PageServer:
    with _guarded() as guards, redirect_stdout(StringIO()):
        server = PageServer(host=HOST, port=port, label=label, verbose=False)
    if not guards:
        server.stop()
        raise ViewError("this version of viser serves in a way that cannot be guarded: install the one of the lock")
    if port not in (0, server.get_port()):
        stop(server)
        raise ViewError(f"--port {port} is taken: name another, or 0 for one that is free")
    return server


def address(server: PageServer) -> str:
    return f"http://{HOST}:{server.get_port()}"


def stop(server: PageServer) -> None:
    """Stop a server without viser's message."""
    with redirect_stdout(StringIO()):
        server.stop()


@contextmanager
def _guarded() -> Iterator[list[str]]:
    begun: list[str] = []
    unguarded = websockets.asyncio.server.serve

    def begin(*args: Any, process_request: _Answer, **options: Any) -> Any:
        begun.append("guarded")
        return unguarded(*args, process_request=_looks_first(process_request), **options)

    websockets.asyncio.server.serve = begin  # type: ignore[assignment,misc]
    try:
        yield begun
    finally:
        websockets.asyncio.server.serve = unguarded  # type: ignore[misc]


def _looks_first(answer: _Answer) -> _Answer:
    nonce = secrets.token_urlsafe()

    def look(connection: ServerConnection, request: Request) -> Response | None:
        port = connection.local_address[1]
        if why := refusal(request.headers, port):
            return connection.respond(HTTPStatus.FORBIDDEN, f"{why}\n")
        request.headers.pop("Accept-Encoding", None)
        response = answer(connection, request)
        if response is not None:
            response.body = _with_nonce(bytes(response.body), nonce.encode())
            response.headers.pop("Content-Length", None)
            response.headers.update(content_policy(port, nonce), **{"Content-Length": str(len(response.body))})
        return response

    return look


def _with_nonce(page: bytes, nonce: bytes) -> bytes:
    """Mark viser's loader and the script that it unpacks as the page's own."""
    page = page.replace(b"<script ", b'<script nonce="%s" ' % nonce)
    return page.replace(b'createElement("script");', b'createElement("script");e.nonce="%s";' % nonce)
