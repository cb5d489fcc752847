"""Campaigns on a cluster: a scheduler and its workers as processes, some of which are killed."""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest

from colibri.campaigns.engines import Cluster
from colibri.campaigns.factors import CampaignError
from colibri.campaigns.run import fly_campaign
from tests.support.campaigns import MASS, PATIENCE_S, SEEDS, Here, begin, planned, rows, tables_in

DASK = [sys.executable, "-m", "dask"]
ALONE = ["--no-dashboard", "--host", "127.0.0.1"]


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


class Processes:
    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self.address = f"tcp://127.0.0.1:{free_port()}"
        self._stack = stack
        self._folder = folder
        port = self.address.rpartition(":")[2]
        self.start("scheduler", "--port", port, *ALONE, "--no-jupyter")

    def worker(self) -> subprocess.Popen[bytes]:
        options = ["--nthreads", "1", "--no-nanny", "--local-directory", str(self._folder), *ALONE]
        return self.start("worker", self.address, *options)

    def start(self, *words: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen([*DASK, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Processes]:
    with ExitStack() as stack:
        yield Processes(stack, tmp_path / "dask")


@pytest.mark.long
def test_it_is_the_same_table_though_a_worker_is_killed(tmp_path: Path, cluster: Processes) -> None:
    campaign = planned(fly={"duration": 0.6}, seeds=SEEDS, draw={MASS: {"uniform": [0.68, 0.74]}})
    fly_campaign(campaign, Here(), tmp_path / "here")
    first = cluster.worker()
    out = tmp_path / "out"
    with begin(out, "--dask", cluster.address) as flying:
        rows(out, 3)
        first.kill()
        cluster.worker()
        cluster.worker()
        assert flying.wait(PATIENCE_S) == 0
    assert tables_in(out) == tables_in(tmp_path / "here")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://there"])
def test_a_scheduler_that_nobody_runs_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.campaigns.engines.CONNECT_S", 0.2)
    with pytest.raises(CampaignError, match=f"--dask {address}: no scheduler answers there: "):
        Cluster(address)


def test_workers_with_another_version_are_refused() -> None:
    class Client:
        def run(self, function: Any, *_: str, on_error: str) -> dict[str, str | Exception]:
            assert function.__module__.split(".")[0] != "colibri", "a worker may not have it"
            assert on_error == "return"
            return {"tcp://10.0.0.1:1": "0.0.9", "tcp://10.0.0.2:1": PackageNotFoundError()}

    with pytest.raises(CampaignError, match=r"--dask: workers have colibri 0.0.9, none, this is 0\.\d+\.\d+"):
        Cluster(Client())


def test_without_dask_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(CampaignError, match=r"Dask is not installed: pip install colibri-sitl\[campaign\]"):
        Cluster("tcp://127.0.0.1:1")


@pytest.mark.long
def test_a_job_that_kills_its_workers_is_given_up(cluster: Processes) -> None:
    from colibri.campaigns.engines import Killed
    from tests.colibri.campaigns.engines import jobs

    for _ in range(12):  # it takes four with it beside others, and four alone
        cluster.worker()
    given = [0, 1, 2, jobs.KILLS, 3, 4, 5]
    done = dict(Cluster(cluster.address, batch=2).each(jobs.doubled, 10, given))
    assert isinstance(done.pop(jobs.KILLS), Killed)
    assert done == {job: 10 * job for job in given if job != jobs.KILLS}
