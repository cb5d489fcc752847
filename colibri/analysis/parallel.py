"""Work on every core, with a bar that shows how much is done."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def side_by_side(
    work: Callable[[Job], Result],
    jobs: Sequence[Job],
    title: str,
    *,
    quiet: bool,
    worth: Callable[[Job], int],
    keep: Callable[[Result], object] = lambda _result: None,
) -> list[Result]:
    """Do every job in a pool of processes; return the results in the order of the jobs.

    Args:
        work: Does one job; must be a function at module level.
        jobs: Its arguments.
        title: Of the progress bar.
        quiet: Show no bar.
        worth: How far a job moves the bar.
        keep: Is given each result as soon as it is there.
    """
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    workers = max(1, min(os.cpu_count() or 1, len(jobs)))
    with (
        Progress(console=console, disable=quiet or not console.is_terminal) as bar,
        ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool,
    ):
        task = bar.add_task(title, total=sum(map(worth, jobs)))
        futures = {pool.submit(work, job): job for job in jobs}
        try:
            for done in as_completed(futures):
                keep(done.result())
                bar.advance(task, worth(futures[done]))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return [future.result() for future in futures]
