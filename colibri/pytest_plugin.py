"""The pytest plugin: fixture `sitl`, marks and options, files of a failed flight, summary.

Every run of pytest loads it; modules that fly are loaded by the first test that needs them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import pytest

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
_MAX_NAME = 120
"""Characters of a folder's name; a longer one is shortened, with a hash."""
_FLIGHTS = pytest.StashKey["Flights"]()
_LAUNCHER = pytest.StashKey["Launcher"]()
_SUMMARY = pytest.StashKey[Summary]()
_UNWRITTEN = pytest.StashKey[str]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("sitl", "flights in software in the loop")
    add = group.addoption
    add(
        "--sitl-link",
        choices=LINKS,
        default="memory",
        help="memory: plant and autopilot in this process (default); udp: the autopilot in a process of its own",
    )
    add(
        "--sitl-from-scratch",
        action="store_true",
        help="with udp: start plant and autopilot each as a user does, rather than fork the autopilot from a process "
        "that has loaded everything",
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
    for line in MARKS.values():
        config.addinivalue_line("markers", line)
    config.stash[_SUMMARY] = Summary(perf_counter())


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    mark = metafunc.definition.get_closest_marker("seeds")
    if mark is None or "sitl_seed" not in metafunc.fixturenames:
        return
    values = _values(mark, f"{metafunc.definition.name}: ")
    first, last = values["first"], values["last"]
    if not (isinstance(first, int) and isinstance(last, int) and first <= last):
        wrong = f"{metafunc.definition.name}: {_written(mark)}"
        pytest.fail(f"{wrong}: give the first and the last seed, whole numbers", pytrace=False)
    metafunc.parametrize("sitl_seed", range(first, last + 1), indirect=True, ids=lambda seed: f"seed{seed}")


@pytest.fixture
def sitl_seed(request: pytest.FixtureRequest) -> int | None:
    """Return the seed of mark `seeds` or `seed`."""
    mark = request.node.get_closest_marker("seed")
    seed: int | None = getattr(request, "param", None if mark is None else _values(mark)["number"])
    return seed


@pytest.fixture
def sitl_fleet(request: pytest.FixtureRequest, sitl_seed: int | None) -> Iterator[Callable[..., Fleet]]:
    """Return a function that begins fleets: each vehicle with the marks of the test."""
    from colibri.sitl.fleet import begin_fleet

    with ExitStack() as stack:
        flights = _flights(request, sitl_seed, stack)

        def begin(count: int, **changes: Any) -> Fleet:
            with _in_one_line():
                return begin_fleet(flights, count, **changes)

        yield begin


@pytest.fixture
def sitl(request: pytest.FixtureRequest, sitl_seed: int | None) -> Iterator[Sitl]:
    """Return a vehicle that waits for commands, as the marks of the test describe it."""
    with ExitStack() as stack:
        flights = _flights(request, sitl_seed, stack)
        with _in_one_line():
            begun = flights.begin()
        yield begun


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    flights = item.stash.get(_FLIGHTS, None)
    if flights is None:
        return report
    if report.when == "teardown":
        del item.stash[_FLIGHTS]
        return report
    if report.when == "setup" and report.passed:
        return report
    flown = flights.summary()
    setattr(report, FLOWN, flown)
    properties = [("sitl_simulated_s", round(flown["simulated_s"], 6))]
    if report.failed:
        places, said = _kept(item, report, flights)
        properties += [("sitl_kept", place.as_posix()) for place in places]
        report.sections.append(("sitl", said))
    report.user_properties += properties
    item.user_properties += properties  # JUnit XML has those of the report on the teardown
    return report


def _kept(item: pytest.Item, report: pytest.TestReport, flights: Flights) -> tuple[list[Path], str]:
    """Return the folders of a failed test's flights, and a text for the report."""
    link, ground = item.config.getoption("--sitl-link"), item.config.getoption("--sitl-ground")
    again = f"replay: pytest '{item.nodeid}' --sitl-link {link}" + (f" --sitl-ground {ground}" if ground else "")
    folder, crash = _folder(item), getattr(report.longrepr, "reprcrash", None)
    reason = (report.longreprtext if crash is None else crash.message).partition("\n")[0]
    reason = re.sub(r"^[\w.]+\.(?=\w+:)", "", reason)  # the error's name alone, without its module's
    try:
        places = flights.keep(folder, title=item.nodeid, reason=reason)
    except (Exception, SystemExit) as error:  # whatever it is, the test's own failure must be reported
        return [], f"could not keep {folder}: {error}\n{again}"
    shown = [_as_given(item.config, place) for place in places]
    return shown, "\n".join([*(f"flight kept in {place}" for place in shown), again])


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.pluginmanager.register(_Collector(session.config.stash[_SUMMARY]), "sitl-collector")


def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    path = config.getoption("--sitl-hashes")
    if not path or hasattr(config, "workerinput"):
        return
    try:
        lines = (line + "\n" for line in config.stash[_SUMMARY].lines())
        (config.invocation_params.dir / path).write_text("".join(lines), encoding="utf-8")
    except OSError as error:
        config.stash[_UNWRITTEN] = f"sitl: could not write {path}: {error.strerror}"
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


def pytest_unconfigure(config: pytest.Config) -> None:
    if _LAUNCHER in config.stash:
        config.stash[_LAUNCHER].close()


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    summary = config.stash[_SUMMARY]
    if summary.flights:
        terminalreporter.write_line(summary.line(perf_counter()))
    if _UNWRITTEN in config.stash:
        terminalreporter.write_line(config.stash[_UNWRITTEN], red=True)


class _Collector:
    """Adds up the reports of all workers."""

    def __init__(self, summary: Summary) -> None:
        self._summary = summary

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._summary.add(report.nodeid, report.outcome, getattr(report, FLOWN, None))


def _flights(request: pytest.FixtureRequest, seed: int | None, stack: ExitStack) -> Flights:
    from colibri.sitl.backends.setting import setting_of
    from colibri.sitl.session import Flights

    known: Flights | None = request.node.stash.get(_FLIGHTS, None)
    if known is not None:
        return known
    _forget(_folder(request.node))
    ground = request.config.getoption("--sitl-ground")
    with _in_one_line():
        setting = setting_of([*([{"ground": ground}] if ground else []), *_said(request.node, seed)])
    flights = stack.enter_context(Flights(setting, _launcher(request.config, stack)))
    request.node.stash[_FLIGHTS] = flights
    return flights


@contextmanager
def _in_one_line() -> Iterator[None]:
    """Fail a test in one line if its flight cannot begin."""
    try:
        yield
    except SitlError as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


def _launcher(config: pytest.Config, stack: ExitStack) -> Launcher | None:
    """Return the launcher of this run or worker, if flights use processes.

    While `stack` is open, a worker's processes share one core if there is a worker for each core.
    """
    if config.getoption("--sitl-link") == "memory":
        return None
    from colibri.sitl.backends.launcher import Launcher, one_core

    xdist: dict[str, Any] = getattr(config, "workerinput", {})
    worker = xdist.get("workerid", "").removeprefix("gw")
    stack.enter_context(one_core(int(worker) if worker.isdecimal() else 0, xdist.get("workercount", 0)))
    if _LAUNCHER not in config.stash:
        config.stash[_LAUNCHER] = Launcher(from_scratch=config.getoption("--sitl-from-scratch"))
    return config.stash[_LAUNCHER]


def _said(node: pytest.Item, seed: int | None) -> list[Mapping[str, Any]]:
    said: list[Mapping[str, Any]] = [_values(mark) for mark in reversed(list(node.iter_markers("sitl")))]
    for name, key in (("vehicle", "name"), ("feedback", "kind")):
        mark = node.get_closest_marker(name)
        if mark is not None:
            said.append({name: _values(mark)[key]})
    mark = node.get_closest_marker("wind")
    if mark is not None:
        said.append(_values(mark))
    if seed is not None:
        said.append({"seed": seed})
    return said


def _values(mark: pytest.Mark, of: str = "") -> dict[str, Any]:
    """Return the values of a mark by name; fail in one line, which begins with `of`."""
    names = [name.strip() for name in MARKS[mark.name].partition("(")[2].partition(")")[0].split(",")]
    if mark.name == "sitl":
        needed, names = set(), []
    else:
        needed = {name for name in names if "=" not in name}
        names = [name.partition("=")[0] for name in names]
    values = {**dict(zip(names, mark.args, strict=False)), **mark.kwargs}
    wrong = len(mark.args) > len(names) or not needed <= set(values) or (names and not set(values) <= set(names))
    if wrong:
        pytest.fail(f"{of}mark is {MARKS[mark.name]}; not {_written(mark)}", pytrace=False)
    return values


def _written(mark: pytest.Mark) -> str:
    return f"{mark.name}({', '.join([*map(repr, mark.args), *(f'{k}={v!r}' for k, v in mark.kwargs.items())])})"


def _folder(item: pytest.Item) -> Path:
    name = re.sub(r"[^\w.\-\[\]]+", "-", item.nodeid.replace("::", "-"))
    if len(name) > _MAX_NAME:
        name = f"{name[9 - _MAX_NAME :]}-{sha256(item.nodeid.encode()).hexdigest()[:8]}"
    keep: str = item.config.getoption("--sitl-keep")
    return item.config.invocation_params.dir / keep / name


def _as_given(config: pytest.Config, place: Path) -> Path:
    keep = Path(config.getoption("--sitl-keep"))
    return keep / place.relative_to(config.invocation_params.dir / keep)


def _forget(folder: Path) -> None:
    from colibri.sitl.flight_record import KEPT

    with suppress(OSError):
        for place in (*folder.glob("flight-*/"), folder):
            for name in KEPT:
                (place / name).unlink(missing_ok=True)
            place.rmdir()
        folder.parent.rmdir()
