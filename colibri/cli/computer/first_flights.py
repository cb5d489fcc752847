"""Short flights that compile what nearly every flight and test needs."""

import sys
from time import perf_counter
from typing import Any

from colibri.campaigns.engines.pool import in_order
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, fail

FLIGHTS: dict[str, dict[str, Any]] = {
    "profile flight": {},
    "profile thesis": {"profile": "thesis"},
    "profile flight on sensors": {"feedback": "sensors", "turbulence": "light"},
    "profile path": {"profile": "path"},
    "flight tests": {"sitl": True},
}


def compile_all(*, quiet: bool) -> int:
    """Fly them on all cores; one line at the end, and a progress bar."""
    began_s = perf_counter()
    try:
        in_order(_fly, list(FLIGHTS), "compiling", quiet=quiet)
    except Error as error:
        fail(str(error), EXIT_FAILED)
    if not quiet:
        sys.stdout.write(f"compiled in {perf_counter() - began_s:.0f} s: flights and flight tests start at once\n")
    return 0


def _fly(name: str) -> None:
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
