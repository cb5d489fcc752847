"""`colibri compile`: short flights that compile what nearly every flight and test needs."""

import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib import import_module
from threading import Event, Thread
from time import perf_counter
from typing import Any

from colibri.common.errors import unknown
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.mavlink.links.startup import COMPILING

FLIGHTS: dict[str, dict[str, Any]] = {
    "flight": {},
    "thesis": {"profile": "thesis"},
    "path": {"profile": "path"},
    "sensors": {"feedback": "sensors", "turbulence": "light"},
    "tests": {"sitl": True},
}
_COUNT_EVERY_S = 5.0
_SHARED_BY = 2  # processes that fly each: what one compiles, the other need not; further ones would mostly wait


def compile(args: Namespace) -> int:
    began_s = perf_counter()
    for name in args.what:
        if name not in FLIGHTS:
            fail(unknown("flight to compile", name, FLIGHTS))
    names = [name for name in FLIGHTS if name in (args.what or FLIGHTS)]
    with one_line(EXIT_FAILED):
        _compile(names, quiet=args.quiet)
    if not args.quiet:
        sys.stdout.write(f"compiled for {', '.join(names)} in {perf_counter() - began_s:.0f} s\n")
    return 0


def compile_first(profile: str, *, quiet: bool) -> None:
    """Compile on all cores if nothing was compiled yet: a flight itself compiles most on one."""
    from colibri.common.machine_code.on_disk import folder_to_write, read_only_folders

    folder = folder_to_write()
    if folder and not any(any(kept.glob("colibri.plant.*.nbc")) for kept in (folder, *read_only_folders())):
        if not quiet:
            sys.stderr.write(f"{COMPILING}\n")
        _compile([profile if profile in FLIGHTS else "flight"], quiet=quiet)


def _compile(names: list[str], *, quiet: bool) -> None:
    from colibri.campaigns.engines import in_order

    with nullcontext() if quiet else _progress():
        in_order(_fly, [(name, n) for name in names for n in range(_SHARED_BY)], "compiling", quiet=True)


@contextmanager
def _progress() -> Iterator[None]:
    """Count new machine code on standard error."""
    from colibri.common.machine_code.on_disk import folder_to_write

    folder, ended = folder_to_write(), Event()

    def count() -> None:
        before = {*folder.glob("*.nbc")} if folder else set()
        while folder and not ended.wait(_COUNT_EVERY_S):
            sys.stderr.write(f"compiling: {len({*folder.glob('*.nbc')} - before)} functions so far\n")

    thread = Thread(target=count)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _fly(job: tuple[str, int]) -> None:
    """Fly `name`; the second process begins with matrices and the plant while the first compiles the law."""
    from colibri.common.machine_code.interpretation import interpret_while_waiting

    interpret_while_waiting()
    name, number = job
    options = dict(FLIGHTS[name])
    if options.pop("sitl", False):
        _fly_sitl()
        return
    if number:
        import_module("colibri.autopilot.control.parts.riccati")
        _fly_plant(options)
    from colibri.experiments.flight import fly

    fly("spiral", duration=1.6, **options)


def _fly_plant(options: dict[str, Any]) -> None:
    from colibri.flights import FlightPlan, FlightSpec
    from colibri.flights.in_process import plant_of

    plant_of(FlightPlan.of(FlightSpec.of("spiral", **options)), 1000).go_on()


def _fly_sitl() -> None:
    from colibri.sitl.backends.setting import Setting
    from colibri.sitl.session import Flights

    with Flights(Setting(), None) as flights:
        sitl = flights.begin()
        sitl.takeoff(1.0, wait=False)
        sitl.run(1.0)
