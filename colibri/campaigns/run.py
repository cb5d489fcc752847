"""`colibri.campaign`: fly a campaign."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from numbers import Integral
from pathlib import Path, PurePath
from types import NoneType
from typing import Any
from warnings import warn

from colibri.campaigns.definition import MAX_UNASKED, Campaign, CampaignTables, campaign_of, tables_of
from colibri.campaigns.engines import Cluster, Engine, Pool
from colibri.campaigns.factors import CampaignError
from colibri.campaigns.flights import FlightResult, check, common_of, fly_points
from colibri.campaigns.journal import JOURNAL, open_journal, read_journal
from colibri.campaigns.results import CampaignResults, parquet_writer
from colibri.common.errors import checked
from colibri.common.process.folder_lock import FolderLock
from colibri.flights.effects import NoEffectWarning


def campaign(
    file: str | Path | None = None,
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Any = None,
    resume: bool = False,
    yes: bool = False,
    parquet: bool = False,
    progress: Callable[[FlightResult], object] = lambda _flown: None,
    **tables: Any,
) -> CampaignResults:
    """Fly a campaign.

    Args:
        file: TOML file of the campaign; keywords take precedence.
        out: Folder for tables, figure and journal; by default no files are written.
        workers: Processes; default one per core. In a script, call this under `if __name__ == "__main__":`, as each
            process imports the script.
        executor: A `distributed.Client` or the address of a Dask scheduler, instead of processes.
        resume: Continue the campaign in `out`.
        yes: Allow more than 10⁶ flights.
        progress: Called with each flight as it ends.
        tables: As in the file: `fly={"duration": 30}, grid={"track": ["spiral"]}, draw={...}, seeds="1-20"`, `metrics`,
            `logs`, `name`, `root_seed`, `paired`. Values may be objects, as in `colibri.fly`; metrics may be functions
            of a `Flight`.
    """
    checked("out", out, (str, PurePath, NoneType), "a folder", CampaignError)
    planned = campaign_of(tables_of(CampaignTables, file, tables))
    engine = engine_of(workers, executor)
    folder = Path(out) if out else None
    results = fly_campaign(planned, engine, folder, resume=resume, yes=yes, parquet=parquet, progress=progress)
    for note in results.notes:
        warn(note, NoEffectWarning, stacklevel=2)
    return results


def engine_of(workers: int | None, executor: Any) -> Engine:
    if executor is None:
        if workers is not None and not (isinstance(workers, Integral) and workers >= 1):
            raise CampaignError(f"workers: must be a whole number of at least 1, not {workers}")
        return Pool(workers)
    if workers is not None:
        raise CampaignError("workers: not used with a cluster: leave it out")
    if not isinstance(executor, str) and not hasattr(executor, "submit"):
        raise CampaignError(f"executor: must be an address or a distributed.Client, not {type(executor).__name__}")
    return Cluster(executor)


def fly_campaign(
    planned: Campaign,
    engine: Engine,
    out: Path | None,
    *,
    resume: bool = False,
    yes: bool = False,
    parquet: bool = False,
    progress: Callable[[FlightResult], object] = lambda _flown: None,
    begun: Callable[[int], object] = lambda _kept: None,
    kind: type[CampaignResults] = CampaignResults,
) -> CampaignResults:
    """Fly the flights missing in `out`; the tables are written also if interrupted."""
    if planned.flights > MAX_UNASKED and not yes:
        raise CampaignError(f"{planned.flights} flights: confirm with --yes")
    if parquet:
        parquet_writer()
    common = common_of(planned, remote=engine.is_remote)
    notes = check(planned.samples(), common, ignored=("seed",) if planned.draw else ())
    with ExitStack() as held:
        journal = None
        if out is not None:
            try:
                held.enter_context(closing(FolderLock(out, "--out")))
            except OSError as error:
                raise CampaignError(f"cannot write to --out {out}: {error.strerror}") from error
            journal = held.enter_context(open_journal(out, planned, common, resume=resume))
            held.callback(
                lambda: kind(planned, {it.flight: it for it in read_journal(out / JOURNAL)}).save(out, parquet=parquet)
            )
            begun(len(journal.kept))
        flown: dict[int, FlightResult] = {} if journal is None else journal.kept
        done = frozenset(flown)
        left = (point for point in planned.points() if point.flight not in done)
        for each in held.enter_context(closing(fly_points(left, common, engine))):
            if journal is None:
                flown[each.flight] = each
            else:
                journal.add(each)
            progress(each)
    results = kind(planned, flown, notes)
    if factors := results.without_effect():
        results.notes.append(f"no effect: {' and '.join(factors)} (flights that differ only in these are identical)")
    return results


class FlightBar:
    def __init__(self, title: str, flights: int, *, quiet: bool) -> None:
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        console = Console(stderr=True)
        texts, numbers = ("{task.fields[rate]}", "{task.fields[lost]}"), (BarColumn(), MofNCompleteColumn())
        columns = ("{task.description}", *numbers, *texts, TimeRemainingColumn())
        hidden = quiet or not console.is_terminal
        self._bar = Progress(  # without a thread, which would keep workers from being forked
            *columns, console=console, disable=hidden, auto_refresh=False, speed_estimate_period=300.0
        )
        self._task = self._bar.add_task(escape(title), total=flights, rate="", lost="", start=False)
        self._flown = self._lost = 0

    def begun(self, kept: int) -> None:
        self._bar.start()
        self._bar.start_task(self._task)
        self._bar.update(self._task, completed=kept, refresh=True)

    def ended(self, flown: FlightResult) -> None:
        self._flown += 1
        self._lost += flown.verdict.is_lost
        elapsed_s = self._bar.tasks[self._task].elapsed or 0.0
        rate = f"{self._flown / elapsed_s:.1f} flights/s" if elapsed_s else ""
        lost = f"{100.0 * self._lost / self._flown:.1f} % lost"
        self._bar.update(self._task, advance=1, rate=rate, lost=lost, refresh=True)

    def close(self) -> None:
        self._bar.stop()
