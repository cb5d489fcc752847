"""`make bench`: flights beside RotorPy's, and what is said where there is none."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from colibri.bench import speed
from tools import bench as rotorpy_peer
from tools.bench import main


def test_a_missing_peer_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rotorpy_peer, "find_spec", lambda _: None)
    monkeypatch.setattr(speed, "real_time_factor", lambda *_: 1.0)
    out = tmp_path / "flights.json"
    assert main(["--runs", "1", "--duration", "0.2", "--out", str(out), "--only", "flights"]) == 0
    flights = json.loads(out.read_text(encoding="utf-8"))["flights"]
    assert all(set(rate) == {"memory", "udp"} for rate in flights["rates_hz"].values())
    assert capsys.readouterr().err == f"colibri: {rotorpy_peer.MISSING}\n"
    assert "colibri-sitl[bench]" in rotorpy_peer.MISSING


@pytest.mark.skipif(not find_spec("rotorpy"), reason="needs RotorPy, which the lock leaves out")
def test_the_peer_flies() -> None:
    assert rotorpy_peer.real_time_factor(100, 0.2) > 0.0
