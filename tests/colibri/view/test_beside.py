"""A flight beside its page: the same to the last bit, whatever browsers do."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
import viser
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from colibri.cli.main import main
from colibri.experiments.flight import fly

DURATION_S = 2.0


def hangs(browser: ClientConnection) -> None:
    """Read nothing, ever."""


def leaves(browser: ClientConnection) -> None:
    """Go without a word."""
    browser.socket.close()


@pytest.fixture(scope="module")
def unwatched() -> str:
    return fly("lemniscate", duration=DURATION_S, link="memory").sha256


@pytest.mark.parametrize("behave", [hangs, pytest.param(leaves, marks=pytest.mark.long)])
def test_a_flight_beside_its_page_is_the_same(
    unwatched: str, behave: Callable[[ClientConnection], None], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    opened: list[str] = []

    def browse(url: str) -> None:
        protocol = Subprotocol(f"viser-v{viser.__version__}")
        begun = connect(url.replace("http", "ws"), origin=Origin(url), subprotocols=[protocol], close_timeout=0.0)
        held.callback(begun.close)
        behave(begun)
        opened.append(url)

    monkeypatch.setattr("webbrowser.open", browse)
    flight = ["fly", "lemniscate", "--duration", str(DURATION_S), "--speed", "max", "--no-figures", "--quiet"]
    with ExitStack() as held:
        assert main([*flight, "--view", "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(opened) == 1
    assert report["trajectory_sha256"] == unwatched
