"""The pytest plugin: fixture `sitl`, its marks and options, what a failed flight leaves, and the sum of a run.

It is loaded by every run of pytest where this package is installed. What flies is loaded by the first test that does.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import pytest

from colibri.sitl.backends.setting import SettingError, setting_of
from colibri.sitl.errors import SitlError
from colibri.sitl.summary import FLOWN, Summary

if TYPE_CHECKING:
    from colibri.sitl.backends.launcher import Launcher
    from colibri.sitl.fleet import Fleet
    from colibri.sitl.session import Flights
    from colibri.sitl.vehicle import Sitl

LINKS = ("memory", "udp")
MARKS = {
    "sitl": "sitl(vehicle=..., feedback=..., wind=..., seed=..., start=..., params=...): what the flight begins with",
    "vehicle": "vehicle(name): what is flown",
    "feedback": 'feedback(kind): what the plant sends to the autopilot, "state" or "sensors"',
    "wind": 'wind(wind, turbulence=None): "5@270" blows from the west with 5 m/s; "light", "moderate" or "severe"',
    "seed": "seed(number): of everything random",
    "seeds": "seeds(first, last): one flight for each seed",
}
_FLIGHTS = pytest.StashKey["Flights"]()
_LAUNCHER = pytest.StashKey["Launcher"]()
_SUMMARY = pytest.StashKey[Summary]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("sitl", "flights in software in the loop")
    add = group.addoption
    add(
        "--sitl-link",
        choices=LINKS,
        default="memory",
        help="memory: plant and autopilot in this process (default); udp: each in a process of its own",
    )
    add(
        "--sitl-from-scratch",
        action="store_true",
        help="with udp: start each process as a user does, rather than by a fork of one that has loaded everything",
    )
    add(
        "--sitl-keep",
        metavar="DIR",
        default="sitl-failures",
        help="where a failed test leaves its flights (default %(default)s)",
    )
    add(
        "--sitl-ground",
        metavar="KEY=VALUE,...",
        help="what links to ground stations do where a test says nothing of them: loss=0.3,jitter_s=0.05",
    )
    add("--sitl-hashes", metavar="FILE", help="write each test's outcome and the hash of its flights there")


def pytest_configure(config: pytest.Config) -> None:
    """Make the marks known."""
    for line in MARKS.values():
        config.addinivalue_line("markers", line)
    config.stash[_SUMMARY] = Summary(perf_counter())


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test for each seed of mark `seeds`."""
    mark = metafunc.definition.get_closest_marker("seeds")
    if mark is not None and "sitl_seed" in metafunc.fixturenames:
        first, last = mark.args
        metafunc.parametrize("sitl_seed", range(first, last + 1), indirect=True, ids=lambda seed: f"seed{seed}")


@pytest.fixture
def sitl_seed(request: pytest.FixtureRequest) -> int | None:
    """Return the seed of the flight of mark `seeds` or `seed`, if there is one."""
    mark = request.node.get_closest_marker("seed")
    seed: int | None = getattr(request, "param", None if mark is None else mark.args[0])
    return seed


@pytest.fixture
def sitl_fleet(request: pytest.FixtureRequest, sitl_seed: int | None) -> Iterator[Callable[..., Fleet]]:
    """Return what begins any number of flights: each with the marks of the test and a system id of its own."""
    from colibri.sitl.fleet import Fleet

    with ExitStack() as stack:
        flights = _flights(request, sitl_seed, stack)

        def begin(count: int, **changes: Any) -> Fleet:
            begun = len(flights.flown)
            return Fleet(_begun(flights, **{"system": begun + number + 1, **changes}) for number in range(count))

        yield begin


@pytest.fixture
def sitl(request: pytest.FixtureRequest, sitl_seed: int | None) -> Iterator[Sitl]:
    """Return a vehicle that waits for orders, as the marks of the test describe it."""
    with ExitStack() as stack:
        yield _begun(_flights(request, sitl_seed, stack))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep the flights of a failed test, and attach the summary of all to the report."""
    report = yield
    flights = item.stash.get(_FLIGHTS, None)
    if flights is None:
        return report
    if report.when == "teardown":
        del item.stash[_FLIGHTS]
        return report
    if report.when == "setup" and report.passed:
        return report
    setattr(report, FLOWN, flights.summary())
    if report.failed:
        folder = Path(item.config.getoption("--sitl-keep")) / _file_name(item.nodeid)
        places = flights.keep(folder)
        link, ground = item.config.getoption("--sitl-link"), item.config.getoption("--sitl-ground")
        lines = [f"flight kept in {place}" for place in places]
        lines.append(
            f"replay: pytest '{item.nodeid}' --sitl-link {link}" + (f" --sitl-ground {ground}" if ground else "")
        )
        report.sections.append(("sitl", "\n".join(lines)))
    return report


def pytest_sessionstart(session: pytest.Session) -> None:
    """Collect what each test has flown, over all workers."""
    session.config.pluginmanager.register(_Collector(session.config.stash[_SUMMARY]), "sitl-collector")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the hashes, if an option names a file for them."""
    path = session.config.getoption("--sitl-hashes")
    if path and not hasattr(session.config, "workerinput"):
        Path(path).write_text("".join(line + "\n" for line in session.config.stash[_SUMMARY].lines()), encoding="utf-8")


def pytest_unconfigure(config: pytest.Config) -> None:
    """End what starts processes."""
    if _LAUNCHER in config.stash:
        config.stash[_LAUNCHER].close()


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say how much was flown, how fast, and with which verdict."""
    summary = config.stash[_SUMMARY]
    if summary.flights:
        terminalreporter.write_line(summary.line(perf_counter()))


class _Collector:
    """Hears every report of the run, those of other workers too."""

    def __init__(self, summary: Summary) -> None:
        self._summary = summary

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take in a report."""
        self._summary.add(report.nodeid, report.outcome, getattr(report, FLOWN, None))


def _flights(request: pytest.FixtureRequest, seed: int | None, stack: ExitStack) -> Flights:
    """Return what the test flies with, ended with `stack`."""
    from colibri.sitl.session import Flights

    known: Flights | None = request.node.stash.get(_FLIGHTS, None)
    if known is not None:
        return known
    try:
        ground = request.config.getoption("--sitl-ground")
        setting = setting_of([*([{"ground": ground}] if ground else []), *_said(request.node, seed)])
    except SettingError as error:
        pytest.fail(str(error), pytrace=False)
    flights = stack.enter_context(Flights(setting, _launcher(request.config)))
    request.node.stash[_FLIGHTS] = flights
    return flights


def _begun(flights: Flights, **changes: Any) -> Sitl:
    """Begin a flight, or fail in one line."""
    try:
        return flights.begin(**changes)
    except SitlError as error:
        pytest.fail(str(error), pytrace=False)


def _launcher(config: pytest.Config) -> Launcher | None:
    """Return what starts the processes of this run, or of this worker; None where flights need none."""
    if config.getoption("--sitl-link") == "memory":
        return None
    from colibri.sitl.backends.launcher import launcher

    if _LAUNCHER not in config.stash:
        config.stash[_LAUNCHER] = launcher(from_scratch=config.getoption("--sitl-from-scratch"))
    return config.stash[_LAUNCHER]


def _said(node: pytest.Item, seed: int | None) -> list[Mapping[str, Any]]:
    """Return the keywords of the marks of a test, the closest last."""
    said: list[Mapping[str, Any]] = [mark.kwargs for mark in reversed(list(node.iter_markers("sitl")))]
    for name in ("vehicle", "feedback"):
        mark = node.get_closest_marker(name)
        if mark is not None:
            said.append({name: mark.args[0]})
    mark = node.get_closest_marker("wind")
    if mark is not None:
        said.append({**dict(zip(("wind", "turbulence"), mark.args, strict=False)), **mark.kwargs})
    if seed is not None:
        said.append({"seed": seed})
    return said


def _file_name(nodeid: str) -> str:
    return re.sub(r"[^\w.\-\[\]]+", "-", nodeid.replace("::", "-"))[-120:]
