"""The server of the page: viser on loopback, with access control and a Content-Security-Policy."""

import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from io import StringIO
from typing import Any

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from colibri.view.access import HOST, content_policy, refusal
from colibri.view.snapshot import ViewError

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
    """Stop a server; viser's message would mix with the page's address."""
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
    """Mark viser's loader, and the script that it unpacks and starts, as the page's own."""
    page = page.replace(b"<script ", b'<script nonce="%s" ' % nonce)
    return page.replace(b'createElement("script");', b'createElement("script");e.nonce="%s";' % nonce)
