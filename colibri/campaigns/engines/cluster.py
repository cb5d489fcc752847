"""Run jobs on a Dask cluster."""

from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import version
from itertools import islice, takewhile
from time import perf_counter
from typing import Any

import cloudpickle

from colibri.campaigns.engines.pool import Job, Killed, Result, Results
from colibri.campaigns.factors import CampaignError

_PACKAGE = "colibri-sitl"
CONNECT_S = 10.0
_AHEAD = 3
"""Batches submitted per core, so that no worker waits for the scheduler."""
_BATCH_S = 2.0
"""Target duration of a batch: the scheduler takes about 200 µs a task."""
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
        if waiting > _AHEAD * self._cores / 2:
            return []
        self._cores = sum(self._client.nthreads().values()) or 1  # asks the scheduler: not for every result
        batches = (list(islice(left, size)) for _ in range(_AHEAD * self._cores - waiting))
        return list(takewhile(bool, batches))

    def _hand_out(self, given: Any, batches: list[list[Job]], waiting: dict[Any, list[Job]], ended: Any) -> None:
        if batches:
            futures = self._client.map(_do, batches, given=given, wanted=version(_PACKAGE), pure=False)
            waiting.update(zip(futures, batches, strict=True))
            ended.update(futures)


def _do(jobs: list[Any], given: tuple[Callable[[Any, Any], Any], Any], wanted: str) -> tuple[float, list[Any]]:
    if version(_PACKAGE) != wanted:
        raise CampaignError(f"--dask: a worker has colibri {version(_PACKAGE)}, the campaign is of {wanted}")
    work, common = given
    began_s = perf_counter()
    results = [work(common, job) for job in jobs]
    return perf_counter() - began_s, results
