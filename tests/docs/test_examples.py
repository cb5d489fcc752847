"""Every file of examples/ prints what its docstring says."""

import ast
import os
import runpy
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

from tests.support.pages import ROOT
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


def printed(folder: Path, *command: str) -> str:
    command = (sys.executable, *command)
    shell = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    done = subprocess.run(command, cwd=folder, env=shell, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


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
        assert printed(tmp_path, str(path), "2").startswith("lost: ")
    elif path.stem.startswith("test_"):
        pytest_of = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull)
        assert promised(path) in printed(tmp_path, *pytest_of, f"--rootdir={tmp_path}", str(path))
    elif path.stem.endswith("_takeoff"):
        with vehicle(tmp_path, speed=SPEED) as flown:
            url = flown.mavsdk_url if path.stem.startswith("mavsdk") else f"udpout:127.0.0.1:{flown.port}"
            assert printed(tmp_path, str(path), url) == promised(path)
    elif path.stem == STARTS_PROCESSES:
        assert printed(tmp_path, str(path)) == promised(path)
    else:
        monkeypatch.chdir(tmp_path)
        runpy.run_path(str(path), run_name="__main__")
        assert capfd.readouterr().out.strip() == promised(path)
