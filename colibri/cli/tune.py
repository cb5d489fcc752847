"""`colibri tune`."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TimeElapsedColumn

from colibri.analysis.tables import print_table
from colibri.common.process.lifecycle import one_line
from colibri.tuning.results import TuningResults
from colibri.tuning.run import Watcher
from colibri.tuning.run import tune as tuned

_TABLES = ("name", "seeds", "check_seeds", "root_seed", "trials", "prune_after")


def tune(args: Namespace) -> int:
    given = {name: value for name, value in vars(args).items() if name in _TABLES}
    title = args.name if "name" in args else args.file.stem
    kept = f"; finished trials are in {args.out}: continue with --resume"
    with one_line(kept=kept), _progress(title, quiet=args.quiet) as watcher:
        shared = {"workers": args.workers, "executor": args.dask, "resume": args.resume}
        results = tuned(args.file, out=args.out, **shared, watcher=watcher, **given)
    if not args.quiet:
        _print(results, args.out)
    return 0


@contextmanager
def _progress(title: str, *, quiet: bool) -> Iterator[Watcher]:
    console = Console(stderr=True)
    columns = ("{task.description}", BarColumn(), "{task.fields[said]}", TimeElapsedColumn())
    bar = Progress(*columns, console=console, disable=quiet or not console.is_terminal)
    task = bar.add_task(escape(title), total=None, said="")

    class Bar(Watcher):
        flights = 0
        trials = ""

        def began(self, trials: int) -> None:
            bar.update(task, total=trials)

        def flown(self, _flown: object) -> None:
            self.flights += 1
            bar.update(task, said=f"{self.trials}{self.flights} flights")

        def ended(self, trials: int, first: float, best: float) -> None:
            self.trials = f"trial {trials}, {first:.4g} as it is, {best:.4g} best, "
            bar.update(task, completed=trials)

        def checking(self, flights: int) -> None:
            self.flights, self.trials = 0, f"check, of {flights}: "

    with bar:
        yield Bar()


def _print(results: TuningResults, out: Path) -> None:
    names = [objective.name for objective in results.tuning.objectives]
    first, best = results.trials[0], results.best
    flights = sum(trial.flights for trial in results.trials)
    pruned = sum(trial.pruned for trial in results.trials)
    title = (
        f"{results.tuning.campaign.name}: {len(results.trials)} trials ({pruned} pruned), {flights} flights, in {out}"
    )
    rows = [(name, f"{a:.4g}", f"{b:.4g}") for name, a, b in zip(names, first.values, best.values, strict=True)]
    rows += [(name, str(first.params[name]), str(best.params[name])) for name in results.tuning.space]
    print_table(title, ("", "as it is", f"trial {best.number}"), rows, names=1)
    if not best.number:
        print("no trial was better than the profile as it is")
    if results.verdict:
        shown = [
            (*each.row[:2], f"{each.before:.4g}", f"{each.after:.4g}", *each.changes)
            for each in results.verdict
            if each.is_objective or each.is_overall
        ]
        title = f"{len(results.tuning.check_seeds)} seeds that no trial has flown: {_said(results)}"
        print_table(title, ("", "flights of", "before", "after", "change", "with 95 %"), shown, names=2)


def _said(results: TuningResults) -> str:
    if results.is_better:
        return "better"
    objectives = [each for each in results.verdict if each.is_objective and each.is_overall]
    worse = any(each.low > 0.0 for each in objectives)
    if worse and any(each.high < 0.0 for each in objectives):
        return "one objective for another"
    return "worse" if worse else "no better"
