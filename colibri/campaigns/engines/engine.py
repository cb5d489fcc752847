"""The interface of engines."""

from collections.abc import Callable, Generator, Iterable
from typing import Any, Protocol, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


class Killed:
    """Replaces the result of a job that killed its worker twice, the second time on its own."""


class Engine(Protocol):
    """Runs many jobs at once; a remote one on other computers."""

    is_remote: bool

    def each(
        self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]
    ) -> Generator[tuple[Job, Result | Killed], None, None]:
        """Yield each job with its result, in order of completion; `work` and `common` are pickled."""
