"""`colibri.campaign`: all flights of a campaign, by any engine, kept as they end."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from colibri.campaigns.definition import Campaign, CampaignTables, campaign_of, tables_of
from colibri.campaigns.engines.engine import Engine
from colibri.campaigns.engines.pool import Pool
from colibri.campaigns.flights import Common, Flown, check, common_of, fly_points
from colibri.campaigns.journal import JOURNAL, Journal, open_journal, read_journal
from colibri.campaigns.results import CampaignResults, parquet_writer
from colibri.campaigns.values import CampaignError
from colibri.common.process.folder_lock import FolderLock

MAX_UNASKED = 1_000_000


def campaign(
    file: str | Path | None = None,
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Any = None,
    resume: bool = False,
    yes: bool = False,
    parquet: bool = False,
    progress: Callable[[Flown], object] = lambda _flown: None,
    **tables: Any,
) -> CampaignResults:
    """Fly a campaign and return what came of it.

    Args:
        file: TOML file of the campaign; keywords take precedence over what is in it.
        out: Folder for the table, its summary, the figure, and what it takes to go on; None: nothing is written.
        workers: Processes; None: one a core. From a script, call this under `if __name__ == "__main__":`, for they
            load the script, too.
        executor: In their place, a `distributed.Client` or the address of a scheduler of Dask.
        resume: Go on with what `out` has of this campaign.
        yes: Also if it has more than 10⁶ flights.
        parquet: Write `flights.parquet`, too.
        progress: Is given each flight as it ends.
        tables: As in the file: `fly={"duration": 30}, grid={"track": ["spiral"]}, draw={...}, seeds="1-20"`, `metrics`,
            `logs`, `name`, `root_seed`, `paired`. Values may be what `colibri.fly` takes: profiles, vehicles, laws;
            metrics may be functions of a `Flight`.

    Raises:
        Error: What the command line would say in one line.
    """
    planned = campaign_of(tables_of(CampaignTables, file, tables))
    engine = engine_of(workers, executor)
    folder = Path(out) if out else None
    return fly_campaign(planned, engine, folder, resume=resume, yes=yes, parquet=parquet, progress=progress)


def engine_of(workers: int | None, executor: Any) -> Engine:
    """Return the engine that is asked for: a pool of processes, or Dask.

    Raises:
        CampaignError: Both are asked for, or it cannot be had.
    """
    if executor is None:
        if workers is not None and workers < 1:
            raise CampaignError(f"workers: must be at least 1, not {workers}")
        return Pool(workers)
    if workers is not None:
        raise CampaignError("workers: a cluster has its own: leave workers out")
    from colibri.campaigns.engines.cluster import Cluster

    return Cluster(executor)


def fly_campaign(
    planned: Campaign,
    engine: Engine,
    out: Path | None,
    *,
    resume: bool = False,
    yes: bool = False,
    parquet: bool = False,
    progress: Callable[[Flown], object] = lambda _flown: None,
    begun: Callable[[int], object] = lambda _kept: None,
) -> CampaignResults:
    """Fly those flights of a campaign that `out` does not have yet, and write its tables; see `campaign`.

    Interrupted, it writes the tables of what was flown. `begun` is given how many flights `out` has already.

    Raises:
        Error: A flight cannot begin, or `out` has something else.
    """
    if planned.flights > MAX_UNASKED and not yes:
        raise CampaignError(f"{planned.flights} flights are many: say --yes if you mean it")
    if parquet:
        parquet_writer()
    common = common_of(planned)
    check(planned.samples(), common)
    if out is None:
        return _fly(planned, common, engine, None, progress)
    try:
        lock = FolderLock(out, "--out")
    except OSError as error:
        raise CampaignError(f"cannot write to --out {out}: {error.strerror}") from error
    with closing(lock), open_journal(out, planned, common, resume=resume) as journal:
        begun(len(journal.kept))
        try:
            return _fly(planned, common, engine, journal, progress)
        finally:
            kept = {each.flight: each for each in read_journal(out / JOURNAL)}
            CampaignResults(planned, kept).save(out, parquet=parquet)


def _fly(
    planned: Campaign,
    common: Common,
    engine: Engine,
    journal: Journal | None,
    progress: Callable[[Flown], object],
) -> CampaignResults:
    flown: dict[int, Flown] = {} if journal is None else journal.kept
    done = frozenset(flown)
    left = (point for point in planned.points() if point.flight not in done)
    with closing(fly_points(left, common, engine)) as ended:
        for each in ended:
            if journal is None:
                flown[each.flight] = each
            else:
                journal.add(each)
            progress(each)
    return CampaignResults(planned, flown)
