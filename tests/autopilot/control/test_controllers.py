"""The interface of a control law: the three that come along, and one of somebody else's."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.control.interface import Controller
from colibri.autopilot.control.profile import load_profile, profile_text
from colibri.autopilot.control.registry import (
    ControllerError,
    DecisionError,
    check_controller,
    check_rotor_speeds,
    load_controller,
)
from colibri.autopilot.control.settings import present_name
from colibri.common.config import SettingsError
from colibri.plant.vehicle.description import load_vehicle
from tests.support.foreign import FlyTheirs, example
from tests.support.states import staying, turned
from tools.harness.processes import fly

PROFILES = {"cascade": "thesis", "global-lpv-mpc": "thesis", "geometric-se3": "se3"}


def build(name: str) -> Controller[Any]:
    vehicle = load_vehicle("hummingbird-thesis")
    return load_controller(name)(load_profile(PROFILES[name]).table(name), vehicle, lambda: 0.0)


@pytest.mark.parametrize("name", PROFILES)
def test_each_keeps_the_interface(name: str) -> None:
    controller = build(name)
    check_controller(name, controller)
    vehicle = load_vehicle("hummingbird-thesis")
    memory = controller.initial(vehicle.hover_speed)
    _, decision = controller.step(memory, 0, turned(0.0), staying(controller.preview.samples))
    check_rotor_speeds(name, decision.rotor_speeds, vehicle.rotors)
    assert decision.rotor_speeds == pytest.approx(np.full(4, vehicle.hover_speed), rel=1e-9)


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("spoil", [{"colour": 1.0}, {"control_interval_s": 0.0}, {"control_interval_s": 0.0005}])
def test_a_wrong_table_is_refused(name: str, spoil: dict[str, float]) -> None:
    table = {**load_profile(PROFILES[name]).table(name), **spoil}
    with pytest.raises(SettingsError, match=next(iter(spoil))):
        load_controller(name)(table, load_vehicle("hummingbird-thesis"), lambda: 0.0)


def test_what_is_no_controller_is_refused() -> None:
    with pytest.raises(ControllerError, match="needs control_interval_us, preview, initial"):
        check_controller("nothing", object())
    controller = build("geometric-se3")
    controller.control_interval_us = 1_500
    with pytest.raises(ControllerError, match="whole milliseconds"):
        check_controller("odd", controller)


@pytest.mark.parametrize("speeds", [[0.0, 0.0, 0.0, np.nan], [0.0] * 3, [0.0, 0.0, 0.0, 9000.0], [0.0, 0.0, 0.0, -1.0]])
def test_what_no_rotor_can_follow_is_refused(speeds: list[float]) -> None:
    with pytest.raises(DecisionError, match="expected 4 from 0 to 8002"):
        check_rotor_speeds("wild", np.array(speeds), load_vehicle("hummingbird-thesis").rotors)


@pytest.mark.parametrize(
    ("track", "rms_m"),
    [
        pytest.param("spiral", 1e-6, marks=pytest.mark.long),
        pytest.param("line", 1e-6, marks=pytest.mark.long),
        ("crown", 1e-3),
    ],
)
def test_the_geometric_controller_tracks_an_ideal_vehicle(tmp_path: Path, track: str, rms_m: float) -> None:
    figures = fly(tmp_path, track, "--profile", "se3", "--link", "memory", "--duration", "23")
    assert figures["rmse_after_20s_m"] < rms_m
    assert figures["solver"] is None


EXAMPLE = example("controllers.md")
THEIRS = ("spiral", "--controller", "their-name", "--link")


@pytest.mark.parametrize("link", ["direct", pytest.param("udp", marks=pytest.mark.long)])
def test_the_example_of_the_docs_flies(fly_theirs: FlyTheirs, tmp_path: Path, link: str) -> None:
    assert len(EXAMPLE.splitlines()) <= 36
    assert fly_theirs(EXAMPLE, *THEIRS, link, "--duration", "25") == (0, "")
    figures = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert figures["controller"] == "their-name"
    assert figures["rmse_after_20s_m"] < 0.5


@pytest.mark.parametrize("link", ["udp", "direct"])
def test_a_foreign_law_that_cannot_be_loaded_is_one_line(fly_theirs: FlyTheirs, link: str) -> None:
    done = fly_theirs(EXAMPLE, "spiral", "--controller", "broken", "--link", link)
    assert done.returncode == 2
    assert done.stderr.startswith("colibri: error: controller broken (their_law:Nowhere) cannot be loaded: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("link", ["direct", pytest.param("udp", marks=pytest.mark.long)])
def test_a_foreign_law_that_cannot_be_built_says_why_in_one_line(fly_theirs: FlyTheirs, link: str) -> None:
    law = "import colibri\n\n\ndef TheirLaw(*_):\n    raise colibri.Error('mind the gap')\n"
    done = fly_theirs(law, *THEIRS, link)
    assert (done.returncode, done.stderr) == (2, "colibri: error: mind the gap\n")


@pytest.mark.parametrize("link", ["direct", pytest.param("udp", marks=pytest.mark.long)])
def test_a_foreign_law_that_goes_wild_ends_in_words(fly_theirs: FlyTheirs, link: str) -> None:
    wild = EXAMPLE.replace("rotor_speeds=", "rotor_speeds=float('nan') * ")
    done = fly_theirs(wild, *THEIRS, link)
    assert done.returncode == 1
    said = "colibri: error: controller their-name gave rotor speeds [nan nan nan nan] at t = 0.000 s: expected 4"
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("link", ["memory", pytest.param("udp", marks=pytest.mark.long)])
def test_an_exception_of_a_foreign_law_loses_the_flight(tmp_path: Path, fly_theirs: FlyTheirs, link: str) -> None:
    raises = EXAMPLE.replace("        error =", "        time_us < 500_000 or {}['gain']\n        error =")
    done = fly_theirs(raises, *THEIRS, link)
    out = tmp_path / "out"
    why = "controller their-name raised at t = 0.500 s: KeyError: 'gain'"
    assert done.returncode == 1
    assert done.stderr.startswith(f"colibri: error: {why}; its traceback is in {out / 'failure.txt'}")
    assert done.stderr.count("\n") == 1
    kept = (out / "failure.txt").read_text(encoding="utf-8")
    assert "their_law.py" in kept
    assert "{}['gain']" in kept
    assert len((out / "flight.csv").read_text(encoding="utf-8").splitlines()) == 1 + 51
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["lost"].startswith(why)
    assert report["lost_at_s"] == 0.5


def test_a_foreign_law_that_raises_while_it_is_built_is_one_line(tmp_path: Path, fly_theirs: FlyTheirs) -> None:
    raises = EXAMPLE.replace("self.mixer = ", "self.mixer = 1 / 0 * ")
    done = fly_theirs(raises, *THEIRS, "memory")
    said = "colibri: error: controller their-name cannot be built: ZeroDivisionError: division by zero; its traceback"
    assert done.returncode == 2
    assert done.stderr.startswith(said)
    assert "their_law.py" in (tmp_path / "out" / "failure.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("return None, Decision", "return Decision", "returned Decision at t = 0.000 s: expected two, what "),
        ("        error =", "        raise SystemExit(3)\n        error =", "raised at t = 0.000 s: SystemExit: 3"),
    ],
)
def test_what_a_foreign_law_does_in_place_of_deciding_is_said(
    fly_theirs: FlyTheirs, old: str, new: str, said: str
) -> None:
    done = fly_theirs(EXAMPLE.replace(old, new), *THEIRS, "memory")
    assert done.returncode == 1
    assert done.stderr.startswith(f"colibri: error: controller their-name {said}")


def test_what_a_foreign_law_prints_is_shown(fly_theirs: FlyTheirs) -> None:
    prints = EXAMPLE.replace("        error =", "        time_us or print('now', time_us)\n        error =")
    done = fly_theirs(prints, *THEIRS, "udp", "--duration", "0.5")
    assert (done.returncode, done.stderr) == (0, "now 0\n")


def test_a_former_name_is_accepted_with_a_warning(tmp_path: Path) -> None:
    old = tmp_path / "old.toml"
    old.write_text(profile_text("flight").replace("lpv-mpc", "whole-lpv-mpc"), encoding="utf-8")
    present_name.cache_clear()
    with pytest.warns(FutureWarning, match='"whole-lpv-mpc" is now called "lpv-mpc"'):
        profile = load_profile(str(old)).with_choices("whole-lpv-mpc", None)
    assert (profile.controller, profile.controllers) == ("lpv-mpc", load_profile("flight").controllers)
