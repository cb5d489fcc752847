"""`colibri compile`: short flights that compile what nearly every flight and test needs."""

import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from threading import Event, Thread
from time import perf_counter
from typing import Any

from colibri.campaigns.engines import in_order
from colibri.common.errors import unknown
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line

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
    jobs = [name for name in FLIGHTS if name in (args.what or FLIGHTS) for _ in range(_SHARED_BY)]
    with one_line(EXIT_FAILED), nullcontext() if args.quiet else _progress():
        in_order(_fly, jobs, "compiling", quiet=True)
    if not args.quiet:
        sys.stdout.write(f"compiled for {', '.join(dict.fromkeys(jobs))} in {perf_counter() - began_s:.0f} s\n")
    return 0


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


def _fly(name: str) -> None:
    from colibri.common.machine_code.interpretation import interpret_while_waiting

    interpret_while_waiting()
    options = dict(FLIGHTS[name])
    if not options.pop("sitl", False):
        from colibri.experiments.flight import fly

        fly("spiral", duration=1.6, **options)
        return
    from colibri.sitl.backends.setting import Setting
    from colibri.sitl.session import Flights

    with Flights(Setting(), None) as flights:
        sitl = flights.begin()
        sitl.takeoff(1.0, wait=False)
        sitl.run(1.0)
