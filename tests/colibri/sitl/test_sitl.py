"""The pytest plugin as a stranger's test file meets it: marks, failures, the sum at the end, workers, the docs."""

import json
import os
import re
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

from colibri.sitl.backends.setting import Setting
from colibri.sitl.session import Flights
from tests.support.installs import ROOT, build

pytest_plugins = ["pytester"]

DOCS = ROOT / "docs" / "scenarios.md"
MODULE = "colibri.pytest_plugin"
KNOWN = ("-W", "ignore::pytest.PytestUnknownMarkWarning")  # lets a test have an unregistered mark
CACHES = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
HOVER = """
    import pytest

    @pytest.mark.sitl(airborne=3.0)
    @pytest.mark.seeds(4, 5)
    @pytest.mark.wind("3@0", turbulence="light")
    def test_hover(sitl):
        sitl.run(0.2)
"""


@pytest.fixture(scope="module", autouse=True)
def _loaded(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Load here what flies and draws: a run inside this one unloads whatever it was the first to load."""
    with Flights(Setting(airborne=3.0), None) as flights:
        flights.begin()
        flights.keep(tmp_path_factory.mktemp("loaded"))


@pytest.fixture(autouse=True)
def _kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes of a run inside this one find compiled kernels, though it has a home of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", CACHES)


def options() -> list[str]:
    """Return what loads the plugin where this very version of the package is not installed."""
    known = entry_points(group="pytest11")
    return [] if any(entry.value == MODULE for entry in known) else ["-p", MODULE]


@pytest.fixture
def _undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.sitl.session.draw", lambda _flown, _texts, path, **_: path.touch())


def run(pytester: pytest.Pytester, text: str, *more: str) -> pytest.RunResult:
    pytester.makepyfile(text)
    return pytester.runpytest_inprocess(*options(), "-p", "no:cacheprovider", *more)


def verdict(result: pytest.RunResult) -> str:
    (line,) = [line for line in result.outlines if line.startswith("sitl: ")]
    return line.rpartition(" ")[2]


def test_a_run_ends_with_its_sum_which_is_the_same_again(pytester: pytest.Pytester) -> None:
    results = [run(pytester, HOVER, "--sitl-hashes", "hashes", *workers) for workers in ((), ("-n", "2"))]
    for result in results:
        result.assert_outcomes(passed=2)
        result.stdout.re_match_lines(
            [r"sitl: 2 flights, 0\.4 s simulated in .* sim-s per wall-s, verdict [0-9a-f]{16}"]
        )
    assert verdict(results[0]) == verdict(results[1])
    lines = (pytester.path / "hashes").read_text(encoding="utf-8").splitlines()
    names, outcomes, hashes = zip(*(line.split(" ") for line in lines), strict=True)
    assert [name.rpartition("::")[2] for name in names] == ["test_hover[seed4]", "test_hover[seed5]"]
    assert set(outcomes) == {"passed"}
    assert len(set(hashes)) == 2
    assert not (pytester.path / "sitl-failures").exists()


def test_a_flight_is_gone_when_its_test_is_over(pytester: pytest.Pytester) -> None:
    text = """
        import gc
        import weakref

        flown = []

        def test_one(sitl):
            flown.append(weakref.ref(sitl))

        def test_two():
            gc.collect()
            assert flown[0]() is None
    """
    run(pytester, text).assert_outcomes(passed=2)


def test_a_failed_test_keeps_its_flight_for_replay(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
        import pytest

        @pytest.mark.sitl(airborne=3.0)
        def test_up(sitl):
            sitl.wait_until(lambda: sitl.position[2] > 4.0, within=0.3, what="the climb")
        """,
        "--junitxml=junit.xml",
    )
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "*NotInTimeError: the climb took longer than 0.3 s: t = 0.3?? s, hold, armed, at (*",
            "flight kept in sitl-failures*",
            "replay: pytest 'test_a_failed*.py::test_up' --sitl-link memory",
        ]
    )
    (folder,) = (pytester.path / "sitl-failures").iterdir()
    assert {path.name for path in folder.iterdir()} == {
        *("flight.csv", "flight.json", "flight.png", "ground.tlog", "plant.tlog")
    }
    assert all(path.stat().st_size > 100 for path in folder.iterdir())
    assert (folder / "flight.csv").read_text(encoding="utf-8").splitlines()[-1].endswith(",1.0,hold")
    facts = json.loads((folder / "flight.json").read_text(encoding="utf-8"))
    assert facts["test"].endswith("::test_up")
    assert facts["reason"].startswith("NotInTimeError: the climb took longer")
    assert (facts["setting"]["airborne"], facts["simulated_s"]) == (3.0, pytest.approx(0.3, abs=0.01))
    properties = {each.get("name"): each.get("value") for each in ElementTree.parse("junit.xml").iter("property")}
    assert properties == {"sitl_simulated_s": f"{facts['simulated_s']:g}", "sitl_kept": f"sitl-failures/{folder.name}"}


@pytest.mark.usefixtures("_undrawn")
def test_only_flights_of_tests_that_fail_now_are_kept(pytester: pytest.Pytester) -> None:
    source = """
        import pytest

        @pytest.mark.sitl(airborne=3.0)
        @pytest.mark.parametrize("bad", {bad})
        def test_one(sitl, bad):
            assert not bad

        @pytest.mark.sitl(airborne=3.0)
        def test_two(sitl_fleet):
            sitl_fleet(2)
            assert {two}
    """
    kept = pytester.path / "sitl-failures"
    run(pytester, source.format(bad=[False, True], two=False)).assert_outcomes(passed=1, failed=2)
    assert len(list(kept.iterdir())) == 2
    (kept / "mine").touch()
    run(pytester, source.format(bad=[False], two=True)).assert_outcomes(passed=2)
    run(pytester, source.format(bad=[True, False], two=True), "-k", "one").assert_outcomes(
        passed=1, failed=1, deselected=1
    )
    assert {path.name.rpartition("test_")[2] for path in kept.iterdir()} == {"mine", "one[True]"}


@pytest.mark.parametrize("hashes", [(), ("--sitl-hashes", "sitl-failures/hashes")])
def test_a_failure_is_reported_even_if_its_flight_is_not_kept(
    pytester: pytest.Pytester, hashes: tuple[str, ...]
) -> None:
    (pytester.path / "sitl-failures").touch()  # as good as a folder that cannot be written
    result = run(pytester, "def test_up(sitl):\n    assert sitl.position[2] > 1.0\n", *hashes)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*assert * > 1.0", "could not keep *sitl-failures*test_up: *", "replay: pytest *"])
    result.stdout.no_fnmatch_line("*INTERNALERROR*")
    if hashes:
        result.stdout.fnmatch_lines(["sitl: could not write sitl-failures/hashes: Not a directory"])


@pytest.mark.parametrize(
    ("mark", "line"),
    [
        ("seeds(3)", "test: mark is seeds(first, last), not seeds(3)"),
        ("seeds(3, 1)", "test: seeds(3, 1): give the first and the last seed, whole numbers"),
        ("seed()", "mark is seed(number), not seed()"),
        ("vehicle(model='iris')", 'mark vehicle: unknown argument "model" (choose name)'),
        ("wind('5@270', turbulance='light')", 'mark wind: unknown argument "turbulance" (did you mean "turbulence"?)'),
        ("wind('5@270', 'light', 3)", "mark is wind(wind, turbulence=None), not wind('5@270', 'light', 3)"),
        ("wind('5@270', turbulence='heavy')", 'turbulence: unknown value "heavy" (choose light, moderate, severe)'),
        ("vehicel('iris')", 'unknown mark "vehicel" (did you mean "vehicle"?)'),
        ("turbulence('light')", 'unknown mark "turbulence" (did you mean "sitl(turbulence=...)"?)'),
        ("sitl('iris')", "mark is sitl(NAME=VALUE, ...), not sitl('iris')"),
        ("sitl(winds='3@0')", 'unknown option "winds" (did you mean "wind"?)'),
        ("wind('three')", "wind: must be SPEED@FROM in m/s and degrees, for example 5@270, not three"),
        ("sitl(params={'NO_SUCH': 1.0})", 'unknown parameter "NO_SUCH" (choose *'),
        ("vehicle('no-such')", "*no-such*"),
    ],
)
def test_a_mark_that_is_not_written_so_is_refused_in_one_line(pytester: pytest.Pytester, mark: str, line: str) -> None:
    result = run(pytester, f"import pytest\n\n@pytest.mark.{mark}\ndef test(sitl): pass\n", *KNOWN)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([line.replace("[", "[[]")])
    result.stdout.no_fnmatch_line("*Error*")


@pytest.mark.parametrize("mark", ["seeds(1, 3)", "seed(1)", "wind('5@270')", "vehicle('iris')", "sitl(airborne=3.0)"])
def test_a_mark_without_its_fixture_is_refused(pytester: pytest.Pytester, mark: str) -> None:
    text = f"import pytest\n\n@pytest.mark.{mark}\ndef test(): pass\n"
    result = run(pytester, text)
    result.assert_outcomes(errors=1)
    name = mark.partition("(")[0]
    result.stdout.fnmatch_lines([f"mark {name} has no effect: test uses neither fixture sitl nor sitl_fleet"])
    pytester.makeini(f"[pytest]\nmarkers =\n    {name}: of another plugin\n")
    run(pytester, text).assert_outcomes(passed=1)


@pytest.mark.usefixtures("_undrawn")
def test_failed_tests_of_similar_names_keep_their_flights(pytester: pytest.Pytester) -> None:
    source = """
        import pytest

        @pytest.mark.sitl(airborne=3.0)
        @pytest.mark.parametrize("name", ["a/b", "a-b", "a b", "a:b", "a::b"])
        def test_one(sitl, name):
            sitl.run(0.01)
            assert not name
        """
    run(pytester, source).assert_outcomes(failed=5)
    folders = list((pytester.path / "sitl-failures").iterdir())
    tests = {json.loads((folder / "flight.json").read_text(encoding="utf-8"))["test"] for folder in folders}
    assert len(tests) == len(folders) == 5


@pytest.mark.parametrize(("logging", "workers"), [pytest.param("no", ("-n", "1"), marks=pytest.mark.long), ("all", ())])
def test_junit_has_folder_replay_and_picture_in_one_text(
    pytester: pytest.Pytester, logging: str, workers: tuple[str, ...]
) -> None:
    source = """
        import pytest

        @pytest.mark.sitl(airborne=3.0)
        def test_up(sitl):
            print("mine")
            sitl.hold(lambda: sitl.position[2] > 4.0, for_=0.3)
        """
    result = run(pytester, source, "--junitxml=junit.xml", "-o", f"junit_logging={logging}", *workers)
    result.assert_outcomes(failed=1)
    (case,) = ElementTree.parse(pytester.path / "junit.xml").iter("testcase")
    (out,) = case.findall("system-out")
    assert out.text is not None
    kept, replay, *pictures = out.text.splitlines()[:4]
    folder = kept.removeprefix("flight kept in ")
    assert replay.startswith("replay: pytest 'test_junit")
    assert pictures == [
        f"[[ATTACHMENT|{place}]]" for place in (f"{folder}/flight.png", f"{pytester.path}/{folder}/flight.png")
    ]
    assert ("mine" in out.text) == (logging == "all")
    (failure,) = case.findall("failure")
    assert "stepping.py" not in (failure.text or "")
    assert "sitl.hold(lambda" in (failure.text or "")


def test_a_ground_link_is_bad_by_option_or_mark(pytester: pytest.Pytester) -> None:
    source = """
        import pytest

        def test_as_the_command_line_says(sitl):
            assert (sitl.link.ground.loss, sitl.link.ground.jitter_s) == (0.3, 0.05)
            sitl.set_param("RTL_RETURN_ALT", 7.0)

        @pytest.mark.sitl(ground="loss=0.1")
        def test_as_a_mark_says(sitl):
            assert (sitl.link.ground.loss, sitl.link.ground.jitter_s) == (0.1, 0.0)
        """
    run(pytester, source, "--sitl-ground", "loss=0.3,jitter_s=0.05").assert_outcomes(passed=2)
    result = run(pytester, source, "--sitl-ground", "lost=0.3")
    result.assert_outcomes(errors=1, passed=1)
    result.stdout.fnmatch_lines(['ground: unknown fault "lost" (did you mean "loss"?)'])


def test_who_does_not_fly_does_not_load_what_flies(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        "import sys\n\ndef test():\n    assert not {'numpy', 'numba', 'pymavlink'} & set(sys.modules)\n"
    )
    result = pytester.runpytest_subprocess(*options(), "-p", "no:hypothesispytest")
    result.assert_outcomes(passed=1)
    assert not [line for line in result.outlines if line.startswith("sitl:")]


@pytest.mark.long
@pytest.mark.parametrize("link", ["memory", "udp"])
def test_the_docs_first_test_in_a_strangers_folder(tmp_path: Path, link: str) -> None:
    """The wheel alone, in a folder that knows nothing of this repository; only what is compiled is compiled already."""
    site, stranger = tmp_path / "site", tmp_path / "stranger"
    stranger.mkdir()
    found = re.search(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    (stranger / "test_delivery.py").write_text(found[1], encoding="utf-8")
    with ZipFile(build("wheel", tmp_path)) as wheel:
        wheel.extractall(site)
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--sitl-link", link, "-q"]
    result = subprocess.run(command, cwd=stranger, env=environment, capture_output=True, text=True, check=False)
    assert "3 passed" in result.stdout, result.stdout + result.stderr
    assert "sitl: 3 flights" in result.stdout


@pytest.mark.long
@pytest.mark.parametrize("command", [(str(Path(sys.executable).parent / "pytest"),), (sys.executable, "-m", "pytest")])
def test_a_stranger_who_has_packages_of_the_same_names_flies(tmp_path: Path, command: tuple[str, ...]) -> None:
    for package in ("tools", "mavlink", "autopilot"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("MINE = 1\n")
    (tmp_path / "plant.py").write_text("MINE = 1\n")
    tests = (
        "import autopilot, mavlink, plant, tools",
        "def test_mine():",
        "    assert autopilot.MINE == mavlink.MINE == plant.MINE == tools.MINE",
        "def test_flight(sitl):",
        "    sitl.arm()",
        "    sitl.takeoff(1.0)",
    )
    (tmp_path / "test_mine.py").write_text("\n".join(tests) + "\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    given = [*command, *options(), "-p", "no:cacheprovider", "-q"]
    done = subprocess.run(given, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "2 passed" in done.stdout, done.stdout + done.stderr
