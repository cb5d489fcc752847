"""In place of a pool of processes, for tests that must see what is done, or change it."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from colibri.campaigns.engines.pool import Pool


def in_this_process(
    _pool: Pool, work: Callable[[Any, Any], Any], common: Any, jobs: Iterable[Any]
) -> Iterator[tuple[Any, Any]]:
    """Do what `Pool.each` does, here."""
    for job in jobs:
        yield job, work(common, job)
