import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

import colibri.doctor as checks
from colibri.cli.main import main
from colibri.common.machine_code import on_disk
from colibri.doctor import Finding, Severity, called, ground_station
from colibri.flights.fleet_spec import PLANT_PORT
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import Codec, mav

FINE, FAILED = Finding("one", Severity.FINE, "there"), Finding("other", Severity.FAILED, "not there", "put it there")
ROUTES = (
    "Iface\tDestination\tGateway\tFlags\n"
    "eth0\t000013AC\t00000000\t0001\n"
    "eth0\t00000000\t010013AC\t0003\n"
)  # fmt: skip


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mine:
        mine.bind((checks.HOST, 0))
        yield mine.getsockname()[1]


def test_this_computer_flies() -> None:
    """What the tests themselves need is there; whether a port is free depends on who else flies here."""
    found = list(checks.examine([checks.packages, checks.loopback, checks.machine_code, checks.flight]))
    assert [finding.verdict for finding in found] == [Severity.FINE] * 4
    assert "times real time" in found[-1].found


def test_what_failed_is_shown_with_what_to_do_and_ends_with_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(checks, "CHECKS", (lambda: FINE, lambda: None, lambda: [FINE, FAILED]))
    assert main(["doctor"]) == 1
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["fine", "one", "there"],
        ["fine", "one", "there"],
        ["failed", "other", "not", "there"],
        ["→", "put", "it", "there"],
    ]
    monkeypatch.setattr(checks, "CHECKS", (lambda: FINE,))
    assert main(["doctor"]) == 0


def test_packages_that_are_missing_too_old_or_others_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    has, others = checks.version_of, {"daqp": None, "numpy": "1.20.0", "rich": "0.0.1", "optuna": None}
    monkeypatch.setattr(checks, "version_of", lambda name: others[name] if name in others else has(name))
    needed, locked = checks.packages(), checks.lock()
    assert (needed.verdict, needed.found[:45]) == (Severity.FAILED, "daqp is missing, numpy is 1.20.0, not >=2.0, ")
    assert locked is not None
    assert locked.verdict is Severity.NOTE
    assert "rich is 0.0.1, not ==" in locked.found
    (tune,) = [finding for finding in checks.extras() if finding.checked == "extra tune"]
    assert (tune.verdict, tune.advice) == (Severity.NOTE, "if you need it: pip install 'colibri-sitl[tune]'")


def test_the_port_of_the_plant_must_be_free(monkeypatch: pytest.MonkeyPatch, taken: int) -> None:
    monkeypatch.setattr(checks, "PLANT_PORT", taken)
    monkeypatch.setattr(checks, "GROUND_PORT", taken)
    ground, _, plant = checks.ports()
    assert ground.verdict is Severity.FINE
    assert f"(process {os.getpid()}) is listening" in ground.found
    assert plant.verdict is Severity.FAILED
    assert plant.found.startswith("taken by ")
    assert PLANT_PORT == 14560


def test_the_way_out_of_a_container_is_the_default_gateway(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert checks.gateway(ROUTES) == "172.19.0.1"
    assert checks.gateway("\n".join(ROUTES.splitlines()[:2])) is None
    (tmp_path / "routes").write_text(ROUTES, encoding="ascii")
    monkeypatch.setattr(checks, "_ROUTES", tmp_path / "routes")
    monkeypatch.setattr(checks, "_CONTAINERS", (tmp_path,))
    found = checks.beyond()
    assert found is not None
    assert "--gcs udpout:172.19.0.1:14550" in found.advice
    monkeypatch.setattr(checks, "_CONTAINERS", (tmp_path / "none",))
    monkeypatch.setattr(checks, "_in_wsl", lambda: False)
    assert checks.beyond() is None


def test_a_folder_for_machine_code_that_is_none_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_disk, "folders", list)
    found = checks.machine_code()
    assert (found.verdict, found.advice) == (Severity.NOTE, "name a folder: NUMBA_CACHE_DIR=FOLDER")


@pytest.mark.parametrize(("kind", "is_one"), [(mav.MAV_TYPE_GCS, True), (mav.MAV_TYPE_QUADROTOR, False)])
def test_a_ground_station_is_known_by_its_heartbeat(kind: int, *, is_one: bool) -> None:
    beat = Codec(255, 190).encode("HEARTBEAT", kind, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3)
    link = open_ground_link("udpin:127.0.0.1:0")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.sendto(beat, (checks.HOST, int(link.url.rpartition(":")[2])))
        answers = called(link, within_s=10.0 if is_one else 0.05)
    link.close()
    assert (answers is not None) == is_one
    if answers:
        assert answers.startswith("system 255 at 127.0.0.1:")


def test_a_ground_station_that_is_not_there_is_said(taken: int) -> None:
    link = open_ground_link(f"udpout:127.0.0.1:{taken}")
    found = ground_station(link, 0.05)
    link.close()
    assert found.verdict is Severity.FAILED
    assert found.found == f"no heartbeat over udpout:127.0.0.1:{taken} within 0.05 s"
