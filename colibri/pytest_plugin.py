"""The pytest plugin: fixture `sitl`, marks and options, files of a failed flight, summary.

Every run of pytest loads it; modules that fly are loaded by the first test that needs them.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import pytest

from colibri.sitl import marks as flight_marks
from colibri.sitl.errors import SitlError

if TYPE_CHECKING:
    from colibri.sitl.backends.launcher import Launcher
    from colibri.sitl.session import Fleet, Flights
    from colibri.sitl.vehicle import Sitl

LINKS = ("memory", "udp")
_MAX_NAME = 120  # characters of a folder's name; a longer one is shortened, with a hash
_PLAIN = re.compile(r"[\w./]+(::\w+)*(\[[\w.-]+\])?", re.ASCII)
"""Names of tests that differ as folders, too; others get a hash."""
_FLIGHTS = pytest.StashKey["Flights"]()
_LAUNCHER = pytest.StashKey["Launcher"]()
_SUMMARY = pytest.StashKey[flight_marks.Summary]()
_SAID = pytest.StashKey[str]()
_SAYS_COMPILING = pytest.StashKey[bool]()
_UNWRITTEN = pytest.StashKey[str]()
_REGISTERED = pytest.StashKey[list[str]]()  # names of registered marks, once for each that registers it


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
    words = flight_marks.described if config.getoption("markers") else flight_marks.signature
    for name in flight_marks.MARKS:
        config.addinivalue_line("markers", words(name))
    config.stash[_SUMMARY] = flight_marks.Summary(perf_counter())


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    mark = metafunc.definition.get_closest_marker("seeds")
    if mark is None or "sitl_seed" not in metafunc.fixturenames:
        return
    values = flight_marks.arguments(mark, f"{metafunc.definition.name}: ")
    first, last = values["first"], values["last"]
    if not (isinstance(first, int) and isinstance(last, int) and first <= last):
        wrong = f"{metafunc.definition.name}: {flight_marks.written(mark)}"
        pytest.fail(f"{wrong}: give the first and the last seed, whole numbers", pytrace=False)
    metafunc.parametrize("sitl_seed", range(first, last + 1), indirect=True, ids=lambda seed: f"seed{seed}")


@pytest.fixture
def sitl_seed(request: pytest.FixtureRequest) -> int | None:
    """Return the seed of mark `seeds` or `seed`."""
    mark = request.node.get_closest_marker("seed")
    seed: int | None = getattr(request, "param", None if mark is None else flight_marks.arguments(mark)["number"])
    return seed


@pytest.fixture
def sitl_fleet(request: pytest.FixtureRequest, sitl_seed: int | None) -> Iterator[Callable[..., Fleet]]:
    """Return a function that begins fleets: each vehicle with the marks of the test."""
    from colibri.sitl.session import begin_fleet

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


def pytest_runtest_setup(item: pytest.Item) -> None:
    registered = item.config.stash.get(_REGISTERED, None)
    if registered is None:
        lines: list[str] = item.config.getini("markers")
        registered = item.config.stash[_REGISTERED] = [re.split(r"[:(]", line)[0].strip() for line in lines]
    wrong = flight_marks.without_effect(item, getattr(item, "fixturenames", ()), registered)
    if wrong is not None:
        pytest.fail(wrong, pytrace=False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    flights = item.stash.get(_FLIGHTS, None)
    if flights is None:
        return report
    if report.when == "teardown":
        del item.stash[_FLIGHTS]
        setattr(report, flight_marks.SAID, item.stash.get(_SAID, ""))
        return report
    if report.when == "setup" and report.passed:
        return report
    flown = flights.summary()
    setattr(report, flight_marks.FLOWN, flown)
    properties = [("sitl_simulated_s", round(flown["simulated_s"], 6))]
    if report.failed:
        places, said = _kept(item, report, flights)
        properties += [("sitl_kept", place.as_posix()) for place in places]
        report.sections.append(("sitl", said))
        item.stash[_SAID] = said + flight_marks.attachments(places, item.config.invocation_params.dir)
    report.user_properties += properties
    item.user_properties += properties  # JUnit XML has those of the report on the teardown
    return report


def _kept(item: pytest.Item, report: pytest.TestReport, flights: Flights) -> tuple[list[Path], str]:
    link, ground = item.config.getoption("--sitl-link"), item.config.getoption("--sitl-ground")
    again = f"replay: pytest '{item.nodeid}' --sitl-link {link}" + (f" --sitl-ground {ground}" if ground else "")
    folder, crash = _folder(item), getattr(report.longrepr, "reprcrash", None)
    reason = (report.longreprtext if crash is None else crash.message).partition("\n")[0]
    reason = re.sub(r"^[\w.]+\.(?=\w+:)", "", reason)  # the error's name alone, without its module's
    try:
        places = flights.keep(folder, title=item.nodeid, reason=reason)
    except (Exception, SystemExit) as error:  # whatever it is, the test's own failure must be reported
        return [], f"could not keep {folder}: {error}\n{again}"
    keep = Path(item.config.getoption("--sitl-keep"))
    shown = [keep / place.relative_to(item.config.invocation_params.dir / keep) for place in places]
    return shown, "\n".join([*(f"flight kept in {place}" for place in shown), again])


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.pluginmanager.register(_Collector(session.config), "sitl-collector")


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
    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None]:
        self._config.stash[_SUMMARY].add(report.nodeid, report.outcome, getattr(report, flight_marks.FLOWN, None))
        with flight_marks.in_system_out(self._config, report):
            yield


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
    _say_what_takes_long(request.config)
    flights = stack.enter_context(Flights(setting, _launcher(request.config, stack)))
    request.node.stash[_FLIGHTS] = flights
    return flights


def _say_what_takes_long(config: pytest.Config) -> None:
    """Say once that machine code is compiled; of several workers the first says it."""
    worker: str = getattr(config, "workerinput", {}).get("workerid", "gw0")
    if worker != "gw0" or config.stash.get(_SAYS_COMPILING, False):
        return
    config.stash[_SAYS_COMPILING] = True
    from colibri.common.jit import on_compile

    def report(functions: int) -> None:
        capture = config.pluginmanager.getplugin("capturemanager")
        if functions == 1:
            with capture.global_and_fixture_disabled() if capture else ExitStack():
                sys.stderr.write("\nsitl: compiling, once: a minute and more; colibri compile does it beforehand\n")

    on_compile(report)


@contextmanager
def _in_one_line() -> Iterator[None]:
    try:
        yield
    except SitlError as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


def _launcher(config: pytest.Config, stack: ExitStack) -> Launcher | None:
    """Return the launcher of this worker; its processes share one core if there is a worker for each core."""
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
    marks = [*reversed(list(node.iter_markers("sitl"))), *map(node.get_closest_marker, ("vehicle", "feedback", "wind"))]
    said: list[Mapping[str, Any]] = [flight_marks.setting_values(mark) for mark in marks if mark is not None]
    return said if seed is None else [*said, {"seed": seed}]


def _folder(item: pytest.Item) -> Path:
    name = re.sub(r"[^\w.\-\[\]]+", "-", item.nodeid.replace("::", "-"), flags=re.ASCII)
    if len(name) > _MAX_NAME or not _PLAIN.fullmatch(item.nodeid):
        name = f"{name[9 - _MAX_NAME :]}-{sha256(item.nodeid.encode()).hexdigest()[:8]}"
    keep: str = item.config.getoption("--sitl-keep")
    return item.config.invocation_params.dir / keep / name


def _forget(folder: Path) -> None:
    from colibri.sitl.flight_record import KEPT

    with suppress(OSError):
        for place in (*folder.glob("flight-*/"), folder):
            for name in KEPT:
                (place / name).unlink(missing_ok=True)
            place.rmdir()
        folder.parent.rmdir()
