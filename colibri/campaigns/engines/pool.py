"""The interface of engines, and a pool of processes."""

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from multiprocessing import active_children, current_process, get_context, parent_process
from threading import Thread
from typing import Any, Protocol, TypeAlias, TypeVar

import cloudpickle

from colibri.campaigns.factors import CampaignError
from colibri.common.process.lifecycle import EXIT_FAILED, fail

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


_AHEAD = 2
"""Jobs submitted per worker, so that no worker waits."""
_NO_GUARD = 'worker processes cannot load the script: flights must begin under `if __name__ == "__main__":`'


class Pool:
    """A pool of processes. A killed worker breaks it; submitted jobs are then repeated one by one."""

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
        context = get_context("spawn")
        has_begun = context.Event()
        pool = ProcessPoolExecutor(workers, context, _begin, (packed, has_begun))
        waiting: dict[Future[Any], Job] = {}
        broken: list[Job] = []
        try:
            while not broken:
                for job in jobs:
                    try:
                        waiting[pool.submit(_do, job)] = job
                    except BrokenProcessPool:
                        broken.append(job)
                    if broken or len(waiting) >= _AHEAD * workers:
                        break
                if not waiting:
                    break
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    job = waiting.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        broken.append(job)
                    else:
                        yield job, future.result()
            for future, job in waiting.items():  # the pool broke: of the rest each has its result or never will
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


_given: tuple[Callable[[Any, Any], Any], Any]
"""In a worker: the function and its common argument."""


def _begin(packed: bytes, has_begun: Any) -> None:
    global _given
    has_begun.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()
    _given = cloudpickle.loads(packed)


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
) -> list[Result]:
    """Return results in the order of jobs, and `keep` each at once."""
    found: dict[int, Result] = {}
    with closing(Pool().each(lambda own, job: own(job[1]), work, enumerate(jobs))) as done:
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
    with Progress(console=console, disable=quiet or not console.is_terminal) as bar:
        yield from bar.track(done, total, description=title)
