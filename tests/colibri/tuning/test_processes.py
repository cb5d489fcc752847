import json
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

from colibri.tuning.run import Watcher, fly_tuning
from colibri.tuning.trials import JOURNAL
from tests.support.campaigns import Here
from tests.support.tuning import FILE, files_in, planned, tuned

PATIENCE_S = 120.0
TRIALS = 12


def begin(folder: Path, *options: str) -> subprocess.Popen[str]:
    file = folder / "short.toml"
    file.write_text(FILE.format(trials=TRIALS), encoding="utf-8")
    words = [sys.executable, "-m", "colibri", "tune", str(file), "--workers", "1", "--quiet", "--out"]
    return subprocess.Popen([*words, str(folder / "out"), *options], stderr=subprocess.PIPE, text=True)


def wait_for(folder: Path, words: str, least: int) -> None:
    """Wait until the journal has as many lines with these words."""
    until_s = monotonic() + PATIENCE_S
    journal = folder / "out" / JOURNAL
    while not journal.exists() or journal.read_text(encoding="utf-8").count(words) < least:
        assert monotonic() < until_s
        sleep(0.005)


class Joined(Watcher):
    """Has a second process join after the first trial, and goes on when that process has begun one."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.second: subprocess.Popen[str] | None = None

    def ended(self, trials: int, _first: float, _best: float) -> None:
        if trials == 1:
            self.second = begin(self._folder, "--resume")
            wait_for(self._folder, '"process":1', 1)


@pytest.mark.long
def test_a_second_process_joins(tmp_path: Path) -> None:
    watcher = Joined(tmp_path)
    fly_tuning(planned(trials=TRIALS), Here, tmp_path / "out", watcher=watcher)
    assert watcher.second is not None
    _, said = watcher.second.communicate(timeout=PATIENCE_S)
    assert (watcher.second.returncode, said) == (0, "")
    logs = [json.loads(line) for line in (tmp_path / "out" / JOURNAL).read_text(encoding="utf-8").splitlines()]
    by = [each["user_attr"]["process"] for each in logs if "process" in each.get("user_attr", {})]
    assert len(by) == TRIALS
    assert set(by) == {0, 1}
    rows = (tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert [int(row.split(",")[0]) for row in rows] == list(range(TRIALS))


@pytest.mark.long
def test_it_is_interrupted_and_says_how_to_go_on(tmp_path: Path) -> None:
    with begin(tmp_path) as first:
        wait_for(tmp_path, '"pruned"', 1)
        first.terminate()
        _, said = first.communicate(timeout=PATIENCE_S)
    assert first.returncode == 143
    out = tmp_path / "out"
    assert said == f"colibri: error: ended by SIGTERM; finished trials are in {out}: continue with --resume\n"


@pytest.mark.long
@pytest.mark.parametrize("least", range(20))
def test_it_is_killed_at_any_instant_and_goes_on(tmp_path: Path, least: int) -> None:
    tuned(tmp_path / "expected", trials=TRIALS)
    with begin(tmp_path) as first:
        wait_for(tmp_path, "\n", 3 * least)
        first.kill()
    with begin(tmp_path, "--resume") as second:
        assert second.wait(PATIENCE_S) == 0
    assert files_in(tmp_path / "out") == files_in(tmp_path / "expected")
