"""Every file of examples/ prints what its docstring says."""

import ast
import os
import runpy
from pathlib import Path
from textwrap import dedent

import pytest

from tests.support.pages import ROOT, run
from tools.harness.processes import vehicle

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
LINES = 40
SLOW = {"learn_hover", "mavsdk_takeoff", "test_return"}
LEARNS = "learn_hover"  # run for two generations only
STARTS_PROCESSES = "campaign_and_plot"
SPEED = 3.0  # of vehicles for clients, times real time


def promised(path: Path) -> str:
    said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return dedent(said.partition("Prints:\n")[2]).strip()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LINES
    assert promised(path)


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.long] * (path.stem in SLOW)) for path in EXAMPLES],
    ids=lambda path: path.stem,
)
def test_example_prints_what_it_says(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    if path.stem == LEARNS:
        assert run(tmp_path, str(path), "2").startswith("lost: ")
    elif path.stem.startswith("test_"):
        pytest_of = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull)
        assert promised(path) in run(tmp_path, *pytest_of, f"--rootdir={tmp_path}", str(path))
    elif path.stem.endswith("_takeoff"):
        with vehicle(tmp_path, speed=SPEED) as flown:
            scheme = "udpout://" if path.stem.startswith("mavsdk") else "udpout:"
            assert run(tmp_path, str(path), f"{scheme}127.0.0.1:{flown.port}").strip() == promised(path)
    elif path.stem == STARTS_PROCESSES:
        assert run(tmp_path, str(path)).strip() == promised(path)
    else:
        monkeypatch.chdir(tmp_path)
        runpy.run_path(str(path), run_name="__main__")
        assert capfd.readouterr().out.strip() == promised(path)
