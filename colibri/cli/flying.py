"""Fly one track with a progress bar, and report."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

from colibri.analysis.limits import exceeded, loss_exceeds
from colibri.cli.compilation import compile_first
from colibri.common.errors import Error
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import EXIT_FAILED, fail, fail_interrupted, one_line
from colibri.common.spec import from_namespace
from colibri.flights.effects import in_words
from colibri.flights.fly import FlightError, fly_plan
from colibri.flights.folder import occupied, prepare
from colibri.flights.plan import FlightPlan, FrameCount, unseen
from colibri.flights.spec import FlightSpec
from colibri.mavlink.links.startup import COMPILING
from colibri.mavlink.ulog.reader import FILE

if TYPE_CHECKING:
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
        with _progress(plan, quiet=args.quiet) as (progress, say, compiling):
            for note in filter(None, (plan.track_note, in_words(plan.without_effect.items()))):
                say(note)

            def show(sim_time_s: float) -> None:
                if plan.spec.link == "udp" and not args.no_figures:  # while two other processes fly
                    import colibri.analysis.figures  # noqa: F401
                progress(sim_time_s)

            summary = fly_plan(plan, show, say, compiling)
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


Shown: TypeAlias = tuple[Callable[[float], None], Callable[[str], None], Callable[[int], None]]


@contextmanager
def _progress(plan: FlightPlan, *, quiet: bool) -> Iterator[Shown]:
    if quiet:
        yield unseen, unseen, unseen
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TimeElapsedColumn

    texts = ("{task.completed:6.1f} / {task.total:.1f} s", "{task.fields[speed]}")
    columns = ("{task.description}", BarColumn(), *texts, TimeElapsedColumn())
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    bar = Progress(*columns, console=console, disable=not console.is_terminal)
    task = bar.add_task(escape(plan.spec.track), total=plan.spec.duration, speed="", start=False)
    counted = ("{task.completed} functions", BarColumn(), TimeElapsedColumn())
    compiler = Progress(*counted, console=console, disable=not console.is_terminal, transient=True)
    compilation = compiler.add_task("", total=None)
    first_s: list[float] = []
    due_s = 0.0

    def show(sim_time_s: float) -> None:
        nonlocal due_s
        if sim_time_s < due_s:
            return
        due_s = sim_time_s + plan.spec.duration / _UPDATES
        if not first_s:
            compiler.stop()
            bar.start()  # not before something flies: an error of the start stands alone
            bar.start_task(task)
            first_s.append(sim_time_s)
        elapsed_s, flown_s = bar.tasks[task].elapsed or 0.0, sim_time_s - first_s[0]
        speed = f"{flown_s / elapsed_s:.0f} × real time" if elapsed_s and flown_s else ""
        bar.update(task, completed=sim_time_s, speed=speed)

    def say(text: str) -> None:
        console.print(text, markup=False)

    def compiling(functions: int) -> None:
        if not compiler.tasks[compilation].completed:
            say(COMPILING)
            compiler.start()
        compiler.update(compilation, completed=functions)

    try:
        yield show, say, compiling
        bar.update(task, completed=plan.spec.duration)
    finally:
        compiler.stop()
        bar.stop()
