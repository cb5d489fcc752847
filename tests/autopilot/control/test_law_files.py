"""A control law in a file, in a module, as a class or as an object is flown, and travels to workers."""

import pickle
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import cloudpickle
import pytest

import colibri
from colibri.autopilot.control import law_files
from colibri.campaigns.flights import common_of, fly_point
from tests.support.campaigns import Hovers, planned
from tests.support.refusals import refusal_of

LAW = """
from neighbour import PART
from tests.support.campaigns import Hovers as Base


class PID(Base):
    def __init__(self, table, vehicle, clock):
        super().__init__({"part": PART} | table, vehicle, clock)
"""
BAD = [
    ("nowhere.py", "controller nowhere.py: No such file or directory"),
    ("law.py:PDI", 'controller law.py: unknown name "PDI" (did you mean "PID"?)'),
    ("law:PDI", 'controller law: unknown name "PDI" (did you mean "PID"?)'),
    ("nowhere:PID", "controller nowhere cannot be loaded: ModuleNotFoundError: No module named 'nowhere'"),
    ("neighbour.py", "controller neighbour.py: the file has no control law, a class with initial() and step()"),
    ("two.py", "controller two.py: the file has A, B: choose one, two.py:A"),
    ("wrong.py", "controller wrong.py: line 1: invalid syntax"),
    ("raises.py", "controller raises.py cannot be loaded: ZeroDivisionError: division by zero"),
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(law_files, "_provided", {})
    law = "    def initial(self, speed): ...\n    def step(self, *given): ...\n"
    files = {"neighbour": "PART = 0.9", "law": LAW, "two": f"class A:\n{law}\n\nclass B:\n{law}", "wrong": "class :"}
    for name, text in (files | {"raises": "1 / 0"}).items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    yield tmp_path
    for name in (*files, "raises"):
        sys.modules.pop(name, None)


def flown(controller: Any, **options: Any) -> colibri.Flight:
    return colibri.fly("hover", controller=controller, duration=0.2, **options)


def test_a_file_a_module_a_class_and_an_object_fly_alike(folder: Path) -> None:
    flights = [flown(place) for place in ("law.py", "law.py:PID", "law:PID", str(folder / "law.py"))]
    law = colibri.load_controller("law.py")
    vehicle = colibri.load_vehicle("hummingbird")
    flights += [flown(law), flown(law({}, vehicle, lambda: 0.0)), flown("law.py", link="udp")]
    assert len({flight.sha256 for flight in flights}) == 1
    assert [flight.report["controller"] for flight in flights[1:3]] == ["law.py:PID", "law:PID"]
    assert flights[0].sha256 != flown(Hovers).sha256
    profile = colibri.load_profile("flight").replace("controllers.PID", {"part": 1.0})
    assert flown("law.py", profile=profile).sha256 == flown(Hovers).sha256


@pytest.mark.parametrize(("place", "said"), BAD)
def test_a_file_without_a_law_is_refused_in_one_line(place: str, said: str) -> None:
    assert refusal_of(flown, place) == said


def test_a_changed_file_is_loaded_again(folder: Path) -> None:
    before = flown("law.py").sha256
    (folder / "law.py").write_text(LAW.replace('{"part": PART}', '{"part": 0.8}'), encoding="utf-8")
    assert flown("law.py").sha256 != before


def test_an_imported_module_stays_beside_its_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(folder)
    law = import_module("law").PID
    assert flown("law.py").sha256 == flown(law).sha256
    assert pickle.loads(pickle.dumps(law)) is law


def test_a_flight_by_a_file_is_saved_and_read_again(folder: Path) -> None:
    saved = flown("law.py").save(folder / "out")
    assert colibri.read_recording(saved).trajectory_sha256 == flown("law.py").sha256


def test_the_law_of_a_file_travels_to_workers(folder: Path, tmp_path: Path) -> None:
    (folder / "law.py").write_text(LAW.replace("from neighbour import PART", "PART = 0.9"), encoding="utf-8")
    given = {"track": "hover", "duration": 0.2}
    campaign = planned(fly=given, grid={"controller": ["law.py", "law:PID"]})
    packed = cloudpickle.dumps((fly_point, common_of(campaign, remote=True), list(campaign.points())))
    away = "import sys, cloudpickle\nwork, common, points = cloudpickle.load(sys.stdin.buffer)\n"
    away += "for point in points: print(work(common, point).sha256)"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    ran = subprocess.run([sys.executable, "-c", away], input=packed, capture_output=True, cwd=elsewhere, check=False)
    assert ran.stderr == b""
    assert ran.stdout.decode().split() == [flown(law).sha256 for law in ("law.py", "law:PID")]
