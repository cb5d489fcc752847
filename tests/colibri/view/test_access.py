"""Who may use the page, asked as a browser would, at a server that runs."""

import http.client
import re
from collections.abc import Iterator

import pytest

from colibri.view.page.controls import words
from colibri.view.page.server import PageServer, Token, refusal, serve, stop
from colibri.view.snapshot import Snapshot, ViewError

CONNECTS = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Protocol": "viser-v1.1.1",
}


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    begun = serve(0, "test")
    yield begun
    stop(begun)


def status(server: PageServer, headers: dict[str, str]) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=20.0)
    connection.request("GET", "/", headers=headers)
    code = connection.getresponse().status
    connection.close()
    return code


@pytest.mark.parametrize(
    ("origin", "host", "code"),
    [
        ("http://127.0.0.1:{port}", "127.0.0.1:{port}", 101),
        ("http://localhost:{port}", "localhost:{port}", 101),
        ("http://evil.example", "127.0.0.1:{port}", 403),
        ("http://evil.example:{port}", "evil.example:{port}", 403),
        ("http://127.0.0.1:1", "127.0.0.1:{port}", 403),
        ("https://127.0.0.1:{port}", "127.0.0.1:{port}", 403),
        ("null", "127.0.0.1:{port}", 403),
        (None, "127.0.0.1:{port}", 403),
    ],
)
def test_a_page_of_another_origin_cannot_connect(server: PageServer, origin: str | None, host: str, code: int) -> None:
    port = server.get_port()
    headers = CONNECTS | {"Host": host.format(port=port)}
    if origin is not None:
        headers["Origin"] = origin.format(port=port)
    assert status(server, headers) == code


def test_the_page_is_served_under_its_own_names_alone(server: PageServer) -> None:
    port = server.get_port()
    assert status(server, {"Host": f"localhost:{port}"}) == 200
    assert status(server, {"Host": f"rebound.example:{port}"}) == 403


def test_only_marked_scripts_run_on_the_page(server: PageServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=20.0)
    connection.request("GET", "/", headers={"Accept-Encoding": "gzip"})
    answer = connection.getresponse()
    page, policy = answer.read().decode(), answer.headers["Content-Security-Policy"]
    connection.close()
    (nonce,) = re.findall(r"script-src 'nonce-([^']+)' 'wasm-unsafe-eval';", policy)
    assert "default-src 'none'" in policy
    assert page.count("<script ") == page.count(f'<script nonce="{nonce}" ') == 1
    assert page.count('createElement("script")') == page.count(f'createElement("script");e.nonce="{nonce}";') == 1


def test_names_and_texts_from_outside_are_text() -> None:
    hostile = "</p><img src=x onerror='alert(1)'> **bold** &lt;\n\x1b"
    place, level = (0.0,) * 3, (1.0, 0.0, 0.0, 0.0)
    now = Snapshot(time_s=0.0, position_enu_m=place, attitude=level, mode=hostile, battery=hostile, texts=(hostile,))
    shown = words([hostile], [now])
    assert "<img" not in shown
    assert shown.count("</p>") == 1
    assert shown.count("&lt;/p&gt;&lt;img src=x onerror=&#x27;alert(1)&#x27;&gt; **bold** &amp;lt;\ufffd\ufffd") == 4


def test_no_tunnel_leads_to_it(server: PageServer) -> None:
    assert server.request_share_url() is None


def test_a_port_that_is_taken_is_refused(server: PageServer) -> None:
    with pytest.raises(ViewError, match="taken"):
        serve(server.get_port(), "another")


def test_headers_count_however_they_are_written() -> None:
    assert refusal({"Host": "127.0.0.1:80", "Upgrade": "WebSocket"}, 80) is not None


def test_a_token_is_known_whole_or_not() -> None:
    token = Token.new()
    assert token.matches(f" {token.text}\n")
    assert not token.matches(token.text[:-1])
    assert not token.matches("")
    assert not token.matches("ü")
    assert Token.new() != token
