"""Access control of the page.

Pages of other sites can open connections to loopback, with their address in `Origin`. A foreign name that resolves to
loopback (DNS rebinding) shows in `Host`.
"""

import secrets
from collections.abc import Mapping
from typing import NamedTuple

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
    """Return headers by which a browser runs the page's own scripts only, and connects to this server only."""
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
