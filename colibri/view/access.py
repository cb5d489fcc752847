"""Who may use the page: it is for this computer's browsers, from its own address; commands need the token as well.

A page of another site can open connections to loopback, too: its browser then says so in `Origin`. A name of another
site that is made to lead to loopback (DNS rebinding) shows in `Host`.
"""

import secrets
from collections.abc import Mapping
from typing import NamedTuple

HOST = "127.0.0.1"
_TOKEN_BYTES = 12
_OURS = (HOST, "localhost")


class Token(NamedTuple):
    """What a browser has to know before it may command."""

    text: str

    @classmethod
    def new(cls) -> "Token":
        """Return one that nobody can guess."""
        return cls(secrets.token_urlsafe(_TOKEN_BYTES))

    def matches(self, text: str) -> bool:
        """Whether somebody knows it; how long that takes says nothing of how near a guess is."""
        return secrets.compare_digest(self.text.encode(), text.strip().encode())


def refusal(headers: Mapping[str, str], port: int) -> str | None:
    """Return why a request for the page, or a connection of it, is refused; None where it is not.

    Args:
        headers: Of the request, by their names in any case as `websockets` has them.
        port: Where the page is served.
    """
    if headers.get("Host") not in {f"{name}:{port}" for name in _OURS}:
        return "the page is served to this computer alone"
    origin = headers.get("Origin")
    connects = headers.get("Upgrade", "").lower() == "websocket"
    if origin is None:
        return "a connection has to say where it comes from" if connects else None
    if origin not in {f"http://{name}:{port}" for name in _OURS}:
        return f"{origin} may not use this page"
    return None
