"""Tasks a second and memory of a cluster's scheduler: `python -m tools.bench.scheduler [TASKS]`."""

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import psutil

from colibri.campaigns.engines.cluster import Cluster

PORT, WORKERS, THREADS = 18_786, 2, 64
SLEEP_S = 0.01
ALONE = ("--no-dashboard", "--host", "127.0.0.1")


def sleeping(sleep_s: float, job: int) -> int:
    sleep(sleep_s)
    return job


def main() -> None:
    tasks = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    address = f"tcp://127.0.0.1:{PORT}"
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory())

        def start(*words: str) -> psutil.Process:
            with Path(folder, "log.txt").open("ab") as log:
                process = subprocess.Popen([sys.executable, "-m", "dask", *words, *ALONE], stdout=log, stderr=log)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return psutil.Process(process.pid)

        scheduler = start("scheduler", "--port", str(PORT), "--no-jupyter")
        for _ in range(WORKERS):
            start("worker", address, "--nthreads", str(THREADS), "--no-nanny", "--local-directory", folder)
        cluster = Cluster(address, batch=1)
        here = psutil.Process()
        began_s, used_s, used_here_s = perf_counter(), _cpu_s(scheduler), _cpu_s(here)
        for done, _ in enumerate(cluster.each(sleeping, SLEEP_S, range(tasks)), start=1):
            if done % max(1, tasks // 10) == 0:
                rate = done / (perf_counter() - began_s)
                task_us = 1e6 * (_cpu_s(scheduler) - used_s) / done
                here_us = 1e6 * (_cpu_s(here) - used_here_s) / done
                memory_mb = scheduler.memory_info().rss / 1e6
                took = f"{task_us:.0f} µs of the scheduler and {here_us:.0f} µs here each, {memory_mb:.0f} MB"
                print(f"{done} tasks: {rate:.0f} a second, {took}")  # noqa: T201


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


if __name__ == "__main__":
    main()
