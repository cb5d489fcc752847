"""Run jobs on all cores with a progress bar."""

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from typing import TypeVar

from colibri.campaigns.engines.engine import Job, Killed, Result
from colibri.campaigns.engines.pool import Pool
from colibri.campaigns.values import CampaignError

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
    with closing(Pool().each(_numbered, work, enumerate(jobs))) as done:
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


def _numbered(work: Callable[[Job], Result], job: tuple[int, Job]) -> Result:
    return work(job[1])
