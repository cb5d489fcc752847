"""Engines: a pool of processes, or a Dask cluster."""

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from importlib.metadata import version
from itertools import islice, takewhile
from multiprocessing import active_children, current_process, get_context, parent_process
from multiprocessing.util import Finalize
from threading import Thread
from time import perf_counter
from typing import Any, Protocol, TypeAlias, TypeVar

import cloudpickle
import numpy as np

from colibri.campaigns.factors import CampaignError
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.flights import launcher

Job = TypeVar("Job")
Result = TypeVar("Result")


class Killed:
    """The result of a job that killed its worker twice, the second time alone."""


Results: TypeAlias = Generator[tuple[Job, Result | Killed], None, None]


class Engine(Protocol):
    """Runs many jobs at once, a remote one on other computers."""

    is_remote: bool

    def each(self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]) -> Results[Job, Result]:
        """Yield each job with its result, in order of completion; `work` and `common` are pickled."""


_LAST = -1000  # after what multiprocessing does at the end
_AHEAD = 2  # jobs submitted per worker, so that no worker waits
_NO_GUARD = 'worker processes cannot load the script: flights must begin under `if __name__ == "__main__":`'


class Pool:
    """A pool of processes, forked if possible, as loading takes longer than short flights.

    A killed worker breaks it; submitted jobs are then repeated one by one.
    """

    is_remote = False

    def __init__(self, workers: int | None = None) -> None:
        if getattr(current_process(), "_inheriting", False):  # a worker of a script without the guard loads it
            sys.exit(1)
        self._workers = workers or (len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1)

    def each(self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]) -> Results[Job, Result]:
        packed = cloudpickle.dumps((work, common))
        left = iter(jobs)
        while broken := (yield from self._done(packed, left, self._workers)):
            for job in broken:
                if (yield from self._done(packed, iter([job]), 1)):
                    yield job, Killed()

    def _done(self, packed: bytes, jobs: Iterator[Job], workers: int) -> Generator[tuple[Job, Any], None, list[Job]]:
        """Yield jobs with results until all are done or the pool breaks; return those lost."""
        others = set(active_children())
        context = get_context("fork" if launcher.ready_to_fork() else "spawn")
        try:
            has_begun = context.Event()
        except OSError as error:
            raise CampaignError(f"worker processes need /dev/shm to be writable: {error.strerror}") from None
        pool = ProcessPoolExecutor(workers, context, _begin, (packed, has_begun))
        waiting: dict[Future[Any], Job] = {}
        broken: list[Job] = []
        try:
            while True:
                for job in () if broken else jobs:
                    try:
                        waiting[pool.submit(_do, job)] = job
                    except BrokenProcessPool:
                        broken.append(job)
                    if broken or len(waiting) >= _AHEAD * workers:
                        break
                if not waiting:
                    break
                done = wait(waiting, return_when=FIRST_COMPLETED).done
                for future in [each for each in waiting if each in done]:
                    job = waiting.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        broken.append(job)
                    else:
                        yield job, future.result()
        except BaseException:
            for child in set(active_children()) - others:
                child.kill()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        if broken and not has_begun.is_set():
            fail(_NO_GUARD, EXIT_FAILED)
        return broken


_given: tuple[Callable[[Any, Any], Any], Any]  # in a worker: the function and its common argument


def _begin(packed: bytes, has_begun: Any) -> None:
    global _given
    has_begun.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()
    Finalize(None, _end_at_once, exitpriority=_LAST)
    sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__  # of a fork, without the bar
    np.random.seed()  # noqa: NPY002 - forks would all draw the same numbers
    _given = cloudpickle.loads(packed)


def _end_at_once() -> None:
    """End without taking the interpreter apart, which takes 0.2 s once code is compiled; not after an exception."""
    if sys.exc_info()[0] is not None:
        return
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def _do(job: Any) -> Any:
    work, common = _given
    return work(common, job)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


Done = TypeVar("Done")


def in_order(
    work: Callable[[Job], Result],
    jobs: Sequence[Job],
    title: str,
    *,
    quiet: bool,
    keep: Callable[[Result], object] = lambda _result: None,
    engine: Engine | None = None,
) -> list[Result]:
    """Return results in the order of jobs, and `keep` each at once."""
    found: dict[int, Result] = {}
    with closing((engine or Pool()).each(lambda own, job: own(job[1]), work, enumerate(jobs))) as done:
        for (number, job), result in with_bar(done, title, len(jobs), quiet=quiet):
            if isinstance(result, Killed):
                raise CampaignError(f"{title}: the process that did {job} was killed, and again when it did this alone")
            found[number] = result
            keep(result)
    return [found[number] for number in range(len(jobs))]


def with_bar(done: Iterable[Done], title: str, total: int, *, quiet: bool) -> Generator[Done, None, None]:
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, disable=quiet or not console.is_terminal, auto_refresh=False) as bar:
        yield from bar.track(done, total, description=title)


_PACKAGE = "colibri-sitl"
CONNECT_S = 10.0
_BATCHES_AHEAD = 3  # batches submitted per core, so that no worker waits for the scheduler
_BATCH_S = 2.0  # target duration of a batch: the scheduler takes about 200 µs a task
_MAX_BATCH = 500


class Cluster:
    """A Dask cluster. A job that was lost with several workers is repeated alone at the end."""

    is_remote = True

    def __init__(self, client_or_address: Any, *, batch: int | None = None) -> None:
        """Without `batch`, the number of jobs per task adapts."""
        try:
            from distributed import Client
        except ImportError as error:
            raise CampaignError(f"Dask is not installed: pip install {_PACKAGE}[campaign]") from error
        self._batch = batch
        self._cores = 1
        self._ours = isinstance(client_or_address, str)
        try:
            self._client = Client(client_or_address, timeout=CONNECT_S) if self._ours else client_or_address
        except (OSError, ValueError) as error:  # a timeout is an OSError
            words = " ".join(str(error).split()) or type(error).__name__
            raise CampaignError(f"--dask {client_or_address}: no scheduler answers there: {words}") from error
        # A function of the standard library: a worker without colibri could not load one of ours.
        found = self._client.run(version, _PACKAGE, on_error="return").values()
        others = sorted({has if isinstance(has, str) else "none" for has in found} - {version(_PACKAGE)})
        if others:
            self.close()
            raise CampaignError(f"--dask: workers have colibri {', '.join(others)}, this is {version(_PACKAGE)}")

    def close(self) -> None:
        if self._ours:
            self._client.close()

    def each(self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]) -> Results[Job, Result]:
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        client = self._client
        # A task, not data that is spread: whoever has it may go, and it is made again.
        given = client.submit(cloudpickle.loads, cloudpickle.dumps((work, common)), pure=False)
        left = iter(jobs)
        waiting: dict[Any, list[Job]] = {}
        suspects: list[Job] = []
        ended = as_completed(with_results=False)
        size = self._batch or 1
        try:
            while True:
                self._hand_out(given, self._batches(left, size, len(waiting)), waiting, ended)
                alone = not waiting
                if alone:  # only now: Dask holds a worker's end against all that waited there
                    if not suspects:
                        return
                    self._hand_out(given, [[suspects.pop()]], waiting, ended)
                future = next(ended)
                batch = waiting.pop(future)
                error = future.exception()
                if isinstance(error, KilledWorker):
                    if alone:
                        yield batch[0], Killed()
                    else:
                        suspects += batch
                    continue
                if isinstance(error, ModuleNotFoundError):
                    raise CampaignError(f"--dask: {error} on the workers: install it there, or client.upload_file")
                took_s, results = future.result()
                if self._batch is None:
                    size = max(1, min(_MAX_BATCH, round(_BATCH_S * len(batch) / max(took_s, 1e-6))))
                del future
                yield from zip(batch, results, strict=True)
        finally:
            client.cancel([given, *waiting], force=True)
            self.close()

    def _batches(self, left: Iterator[Job], size: int, waiting: int) -> list[list[Job]]:
        """Return batches for the free capacity, many at once to relieve the scheduler."""
        if waiting > _BATCHES_AHEAD * self._cores / 2:
            return []
        self._cores = sum(self._client.nthreads().values()) or 1  # asks the scheduler: not for every result
        batches = (list(islice(left, size)) for _ in range(_BATCHES_AHEAD * self._cores - waiting))
        return list(takewhile(bool, batches))

    def _hand_out(self, given: Any, batches: list[list[Job]], waiting: dict[Any, list[Job]], ended: Any) -> None:
        if batches:
            futures = self._client.map(_do_batch, batches, given=given, wanted=version(_PACKAGE), pure=False)
            waiting.update(zip(futures, batches, strict=True))
            ended.update(futures)


def _do_batch(jobs: list[Any], given: tuple[Callable[[Any, Any], Any], Any], wanted: str) -> tuple[float, list[Any]]:
    if version(_PACKAGE) != wanted:
        raise CampaignError(f"--dask: a worker has colibri {version(_PACKAGE)}, the campaign is of {wanted}")
    work, common = given
    began_s = perf_counter()
    results = [work(common, job) for job in jobs]
    return perf_counter() - began_s, results
