"""The pool of processes: every job has its result, and no worker outlives what it works for."""

import subprocess
import sys
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from time import monotonic, sleep

import psutil
import pytest

from colibri.campaigns.engines import Killed, Pool
from tests.colibri.campaigns.engines import jobs

PATIENCE_S = 120.0


@pytest.mark.long
def test_a_job_that_kills_its_worker_is_given_up() -> None:
    given = [0, 1, 2, jobs.KILLS, 3, 4, 5, 6]
    done = dict(Pool(2).each(jobs.doubled, 10, given))
    assert isinstance(done.pop(jobs.KILLS), Killed)
    assert done == {job: 10 * job for job in given if job != jobs.KILLS}


def test_jobs_are_taken_as_they_are_needed() -> None:
    taken = []

    def endless() -> Iterator[int]:
        for job in count():
            taken.append(job)
            yield job

    results = Pool(1).each(jobs.doubled, 1, endless())
    job, result = next(results)
    assert job == result
    results.close()
    assert len(taken) <= 4


@pytest.mark.parametrize("forks", [True, False])
def test_forked_workers_have_what_is_loaded(forks: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.flights.launcher.ready_to_fork", lambda: forks)
    monkeypatch.setattr(jobs, "loaded", "here")
    assert dict(Pool(2).each(jobs.what_is_loaded, None, range(4))) == dict.fromkeys(range(4), "here" if forks else "")


def test_forked_workers_draw_other_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.flights.launcher.ready_to_fork", lambda: True)
    assert dict(Pool(1).each(jobs.drawn, None, [0]))[0] != dict(Pool(1).each(jobs.drawn, None, [0]))[0]


def workers(folder: Path, number: int) -> list[psutil.Process]:
    until_s = monotonic() + PATIENCE_S
    while len(names := [path.name for path in folder.iterdir()]) < number:
        assert monotonic() < until_s
        sleep(0.02)
    return [psutil.Process(int(name)) for name in names]


def test_workers_end_with_whoever_is_killed(tmp_path: Path) -> None:
    parent = subprocess.Popen([sys.executable, "-m", jobs.__name__, str(tmp_path)])
    with parent:
        found = workers(tmp_path, 2)
        parent.kill()
    assert not psutil.wait_procs(found, PATIENCE_S)[1]


def test_a_failure_of_one_job_ends_the_others_at_once(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        list(Pool(2).each(_fails_beside, str(tmp_path), range(2)))
    assert not any(psutil.pid_exists(int(path.name)) for path in tmp_path.iterdir())


def _fails_beside(folder: str, job: int) -> None:
    if job == 0:
        jobs.named(folder, job)
    workers(Path(folder), 1)
    raise TypeError("unsupported operand")
