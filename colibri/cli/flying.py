"""Fly one track with a progress bar, and report."""

import argparse
import sys
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TYPE_CHECKING

from colibri.analysis.limits import exceeded, loss_exceeds
from colibri.cli.compilation import compile_first
from colibri.common.errors import Error
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import EXIT_FAILED, fail, fail_interrupted, one_line
from colibri.common.spec import from_namespace
from colibri.flights.effects import in_words
from colibri.flights.fly import FlightError, fly_plan
from colibri.flights.folder import occupied, prepare
from colibri.flights.plan import FlightPlan, FrameCount, Watcher
from colibri.flights.spec import FlightSpec
from colibri.mavlink.links.startup import COMPILING
from colibri.mavlink.ulog.reader import FILE

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from colibri.analysis.report import Report

_UPDATES = 500


def fly(args: argparse.Namespace) -> int:
    with one_line():
        plan = FlightPlan.of(from_namespace(FlightSpec, args))
    with occupied(plan.out):
        return _fly(plan, args)


def _fly(plan: FlightPlan, args: argparse.Namespace) -> int:
    prepare(plan.out)
    try:
        compile_first(args.profile, quiet=args.quiet)
        with _Progress(plan, quiet=args.quiet, figures=not args.no_figures) as watcher:
            for note in filter(None, (plan.track_note, in_words(plan.without_effect.items()))):
                watcher.say(note)
            summary = fly_plan(plan, watcher)
    except FlightError as error:
        _keep_what_there_is(plan, str(error))
        if error.said:
            return error.code
        fail(f"{error}; logs are in {plan.out}", error.code)
    except Error as error:
        fail(keep_failure(error, plan.out))
    except KeyboardInterrupt as ended:
        _keep_what_there_is(plan)
        fail_interrupted(ended, f"; logs are in {plan.out}")
    found = _report(plan, summary, figures=not args.no_figures, quiet=args.quiet or args.json)
    if args.json:
        from colibri.analysis.outcome import REPORT

        sys.stdout.write((plan.out / REPORT).read_text(encoding="utf-8"))
    if found["lost"] is not None and loss_exceeds(args.fail_lost, 1, 1):
        fail(f"lost at t = {found['lost_at_s']:.2f} s: {found['lost']}; the logs are in {plan.out}", EXIT_FAILED)
    above = exceeded(args.fail_above, found)
    if above:
        fail(f"--fail-above: {'; '.join(above)}; the logs are in {plan.out}", EXIT_FAILED)
    return 0


def _keep_what_there_is(plan: FlightPlan, why: str | None = None) -> None:
    if not (plan.out / FILE).exists():
        return
    from colibri.analysis.outcome import keep_what_there_is

    keep_what_there_is(plan, why)


def _report(plan: FlightPlan, summary: FrameCount, *, figures: bool, quiet: bool) -> "Report":
    from colibri.analysis.figure_series import FigureSeries
    from colibri.analysis.outcome import keep_flight
    from colibri.analysis.report import print_report

    flown = FigureSeries(plan, summary.frames)
    found = keep_flight(plan, summary, *([flown.add] if figures else []))
    if figures:
        from colibri.analysis.figures import draw_flight

        try:
            draw_flight(flown, plan)
        except OSError as error:
            where = error.filename or plan.out
            fail(f"cannot write {where}: {error.strerror}; the report is in {plan.out}", EXIT_FAILED)
    if not quiet:
        print_report(found, plan.out, flown_by=plan.flown_by)
    return found


class _Progress(Watcher, AbstractContextManager["_Progress"]):
    """Bars and lines on standard error; the slow imports happen on first use, or while other processes start."""

    def __init__(self, plan: FlightPlan, *, quiet: bool, figures: bool) -> None:
        self._spec, self._quiet, self._figures = plan.spec, quiet, figures
        self._first_s: float | None = None
        self._due_s = 0.0

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if self._quiet:
            return
        flight, functions = self._bars[1:]
        if error is None:
            flight.update(flight.task_ids[0], completed=self._spec.duration)
        functions.stop()
        flight.stop()

    @cached_property
    def _bars(self) -> "tuple[Console, Progress, Progress]":
        """Of a flight, and of functions compiled before it."""
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, Progress, TimeElapsedColumn

        console = Console(stderr=True, highlight=False, soft_wrap=True)
        texts = ("{task.completed:6.1f} / {task.total:.1f} s", "{task.fields[speed]}")
        columns = ("{task.description}", BarColumn(), *texts, TimeElapsedColumn())
        flight = Progress(*columns, console=console, disable=not console.is_terminal)
        flight.add_task(escape(self._spec.track), total=self._spec.duration, speed="", start=False)
        counted = ("{task.completed} functions", BarColumn(), TimeElapsedColumn())
        functions = Progress(*counted, console=console, disable=not console.is_terminal, transient=True)
        functions.add_task("", total=None)
        return console, flight, functions

    def starting(self) -> None:
        if not self._quiet:
            import rich.progress  # noqa: F401
        if self._figures:
            import colibri.analysis.figures  # noqa: F401

    def flown(self, sim_time_s: float) -> None:
        if self._quiet or sim_time_s < self._due_s:
            return
        self._due_s = sim_time_s + self._spec.duration / _UPDATES
        flight, functions = self._bars[1:]
        task = flight.task_ids[0]
        if self._first_s is None:
            functions.stop()
            flight.start()  # not before something flies: an error of the start stands alone
            flight.start_task(task)
            self._first_s = sim_time_s
        elapsed_s, flown_s = flight.tasks[task].elapsed or 0.0, sim_time_s - self._first_s
        speed = f"{flown_s / elapsed_s:.0f} × real time" if elapsed_s and flown_s else ""
        flight.update(task, completed=sim_time_s, speed=speed)

    def say(self, text: str) -> None:
        if not self._quiet:
            self._bars[0].print(text, markup=False)

    def compiling(self, functions: int) -> None:
        if self._quiet:
            return
        bar = self._bars[2]
        if not bar.tasks[0].completed:
            self.say(COMPILING)
            bar.start()
        bar.update(bar.task_ids[0], completed=functions)
