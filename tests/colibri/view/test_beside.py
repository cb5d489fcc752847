import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import viser
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from colibri.cli.main import main
from colibri.common.types import Array
from colibri.experiments.flight import fly
from tools.harness.processes import states

DURATION_S = 2.0


def hangs(browser: ClientConnection) -> None:
    """Read nothing, ever."""


def leaves(browser: ClientConnection) -> None:
    """Go without a word."""
    browser.socket.close()


@pytest.fixture(scope="module")
def unwatched() -> str:
    return fly("lemniscate", duration=DURATION_S, link="memory").sha256


@pytest.fixture(scope="module")
def unwatched_hold(tmp_path_factory: pytest.TempPathFactory) -> Array:
    return held_in_wind(tmp_path_factory.mktemp("unwatched"))


@pytest.fixture(params=[hangs, pytest.param(leaves, marks=pytest.mark.long)])
def opened(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Return the addresses that were opened in a browser which behaves badly."""
    addresses: list[str] = []

    def browse(url: str) -> None:
        protocol = Subprotocol(f"viser-v{viser.__version__}")
        begun = connect(url.replace("http", "ws"), origin=Origin(url), subprotocols=[protocol], close_timeout=0.0)
        held.callback(begun.close)
        request.param(begun)
        addresses.append(url)

    monkeypatch.setattr("webbrowser.open", browse)
    with ExitStack() as held:
        yield addresses


def held_in_wind(folder: Path, *options: str) -> Array:
    """Have `colibri sitl` hold a place in turbulence, picked up in the air; return the truth of each frame."""
    stands = ["sitl", "--start", "z=4,psi=90,rotors=4740", "--wind", "6@270", "--turbulence", "moderate", "--quiet"]
    where = ["--gcs", "udpin:127.0.0.1:0", "--plant-port", "0", "--out", str(folder), "--state", str(folder / "state")]
    assert main([*stands, *where, "--speed", "max", "--duration", "4", *options]) == 0
    return states(folder / "0")


def test_a_flight_beside_its_page_is_the_same(unwatched: str, opened: list[str], tmp_path: Path) -> None:
    flight = ["fly", "lemniscate", "--duration", str(DURATION_S), "--speed", "max", "--no-figures", "--quiet"]
    assert main([*flight, "--view", "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert len(opened) == 1
    assert report["trajectory_sha256"] == unwatched


@pytest.mark.long
def test_a_station_vehicle_flies_the_same_beside_its_page(
    unwatched_hold: Array, opened: list[str], tmp_path: Path
) -> None:
    assert (held_in_wind(tmp_path, "--view") == unwatched_hold).all()
    assert len(opened) == 1
    times_s, *places = unwatched_hold[:, [0, 7, 8, 9]].T
    assert times_s[-1] == pytest.approx(4.0, abs=0.1)
    assert max(map(np.ptp, places)) > 0.001  # it flies: turbulence moves it
