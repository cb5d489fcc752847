"""What every engine does, and what a job is that kills whoever does it."""

from collections.abc import Callable, Generator, Iterable
from typing import Any, Protocol, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


class Killed:
    """In place of a result: whoever did the job was killed, and killed again when it had nothing else to do."""


class Engine(Protocol):
    """Does many jobs at once."""

    def each(
        self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]
    ) -> Generator[tuple[Job, Result | Killed], None, None]:
        """Return each job with its result, as they end.

        Args:
            work: (common, job) -> result; a function at module level, or one that cloudpickle can send.
            common: What all jobs need.
            jobs: Taken as they are needed.
        """
