"""`colibri check-controller`: laws that come along satisfy it, each bad one is caught by its check, and can be seen."""

import re
import shlex
from typing import Any

import pytest

import colibri
from colibri import conformance
from colibri.autopilot.control.registry import controller_names
from colibri.common.errors import Error
from colibri.conformance.check import CHECKS, Conformance
from colibri.conformance.step_records import FlownStep
from colibri.conformance.subject import Result
from colibri.plant.vehicle.description import Vehicle
from tests.colibri.conformance import laws
from tests.support.commands import Ran

SHORT_S = 2.0
WITHOUT_FLIGHTS = [area for area in CHECKS if area != "flights"]
FAILS = "global-lpv-mpc"
BAD: dict[type[laws.Good], tuple[str, set[str]]] = {
    laws.Stateful: ("memory", {"the same step twice", "two flights in turn by one law", "stepped again from an old"}),
    laws.Remembering: ("memory", {"stepped again from an old memory"}),
    laws.Unpicklable: ("memory", {"stepped from a memory pickled and read back"}),
    laws.Overwriting: ("memory", {"decisions left as they were"}),
    laws.Scribbling: ("memory", {"references left as they are"}),
    laws.NoUpsideDown: ("limits", {"upside down", "tumbling"}),
    laws.NotFinite: ("limits", {"near the ground, sinking", "standing on the ground"}),
    laws.TooFast: ("limits", {"fast, in any direction", "far from the reference", "references that jump"}),
    laws.Half: ("interface", {"optional members in whole groups"}),
    laws.Forgetful: ("optional", {"charge_ah: charge taken from the battery"}),
    laws.Tilted: ("optional", {"step_attitude: an attitude and a thrust instead of a position"}),
    laws.LateLoading: ("optional", {"warm_up: compiled parts"}),
    laws.Drifting: ("flights", {"hover held, 8 s"}),
    laws.OfTwoTypes: ("restart", {"from its checkpoint, the same flight bit for bit"}),
    laws.LostAnew: ("restart", {"restarted in flight, charge and mass kept", "restarted in flight, without a record"}),
}


TRIED: dict[tuple[type[laws.Good], str], Conformance] = {}


def tried(law: type[laws.Good], area: str) -> Conformance:
    """Return what a law's trial found, once for all tests."""
    if (law, area) not in TRIED:
        TRIED[law, area] = colibri.check_controller(law, only=[area], duration=SHORT_S)
    return TRIED[law, area]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name == colibri.load_profile("flight").controller else pytest.mark.long)
        for name in controller_names()
    ],
)
def test_laws_that_come_along_satisfy_it(name: str) -> None:
    found = colibri.check_controller(name, duration=SHORT_S, only=WITHOUT_FLIGHTS if name == FAILS else ())
    assert found.failures == ""
    assert {row.area for row in found.rows} >= {*WITHOUT_FLIGHTS}
    assert found.passed


def test_the_first_strategy_fails_its_flights() -> None:
    failed = colibri.check_controller(FAILS, duration=20.0, only=["flights"]).failed
    assert [row.tried.split(",")[0] for row in failed][:2] == ["hover held", "spiral"]
    assert "off its track" in failed[1].found
    assert (
        failed[1].see == "colibri fly spiral --controller=global-lpv-mpc --profile=thesis --link=direct "
        "--seed=0 --duration=20.0"
    )


def test_what_keeps_every_promise_passes() -> None:
    found = colibri.check_controller(laws.Good, duration=SHORT_S)
    assert found.failures == ""
    assert {Result.OK, Result.NOT_APPLICABLE, Result.FIGURE} == {row.result for row in found.rows}


@pytest.mark.parametrize("law", BAD)
def test_each_bad_law_is_caught_by_its_check(law: type[laws.Good]) -> None:
    area, expected = BAD[law]
    found = tried(law, area)
    assert not found.passed
    caught = {row.tried for row in found.failed}
    assert all(any(name.startswith(each) for name in caught) for each in expected), caught
    assert len(caught) == len(expected), caught
    for row in found.failed:
        assert row.found
        assert law.__name__ in row.see


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (laws.Listed, "rotor_speeds is not an array of 4 floats: ["),
        (laws.NoAngles, "attitude_reference is not three finite angles: None"),
        (laws.NoDiagnostics, "AttributeError: 'NoneType' object has no attribute 'predicted'"),
    ],
)
def test_a_decision_of_other_types_is_a_failure_and_no_traceback(law: type[laws.Good], said: str) -> None:
    found = colibri.check_controller(law, only=["memory", "limits"])
    assert {row.found[: len(said)] for row in found.failed if row.area == "limits"} == {said}


def test_a_law_that_decides_by_chance_is_caught() -> None:
    assert "the same step twice" in {row.tried for row in tried(laws.Random, "memory").failed}
    caught = {row.tried for row in tried(laws.BuiltOtherwise, "memory").failed}
    assert "the same flight by a new instance" in caught
    assert "the same step twice" not in caught


def test_old_memory_handed_to_a_law_of_another_number() -> None:
    profile = colibri.load_profile("flight").replace("controllers.TableBound", {"gain": 2.0})
    found = colibri.check_controller(laws.TableBound, profile=profile, only=["restart"])
    (row,) = found.failed
    assert row.tried == "built from other numbers, handed the old memory"
    assert row.found == "gain = 2.1: KeyError: 'another gain'"
    with pytest.raises(KeyError, match="another gain"):
        exec(row.see, {"TableBound": laws.TableBound, "profile": profile})


def test_memory_that_cannot_be_kept_is_no_failure_of_a_restart() -> None:
    results = [row.result for row in tried(laws.Unpicklable, "restart").rows]
    assert results == [Result.NOT_APPLICABLE, Result.OK, Result.OK, Result.OK]


def shown(code: str, law: type[laws.Good], capsys: pytest.CaptureFixture[str]) -> str:
    try:
        exec(code, {law.__name__: law, "colibri": colibri})
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return capsys.readouterr().out


def differing(printed: str) -> bool:
    first, second, *_ = map(str, re.findall(r"\[[^\]\[]*\]", printed))
    return first != second


@pytest.mark.parametrize(
    ("law", "at", "said"),
    [
        (laws.Half, 0, "'charge_ah'"),
        (laws.Unpicklable, -1, "PicklingError|AttributeError|TypeError"),
        (laws.Scribbling, -1, r"^\[0, 1, 2"),
        (laws.NoUpsideDown, 0, "ValueError: no model for this roll"),
        (laws.NotFinite, -1, "nan"),
        (laws.TooFast, -1, r"rotor_speeds=array\(\["),
        (laws.Forgetful, -1, r"^0\.0 0\.0$"),
        (laws.Tilted, 0, r"euler=\(-0\.(29|30)"),
        (laws.LostAnew, -1, "RuntimeError: not begun"),
    ],
)
def test_how_to_see_it_shows_it(law: type[laws.Good], at: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    row = tried(law, BAD[law][0]).failed[at]
    assert re.search(said, shown(row.see, law, capsys).strip())


@pytest.mark.parametrize("law", [laws.Overwriting, laws.Remembering, laws.LateLoading])
def test_rotor_speeds_that_differ_are_shown_side_by_side(
    law: type[laws.Good], capsys: pytest.CaptureFixture[str]
) -> None:
    (row,) = tried(law, BAD[law][0]).failed
    assert differing(shown(row.see, law, capsys))


def test_flown_steps_are_taken_again_bit_for_bit() -> None:
    law, steps = conformance.flown_steps("hover", controller="geometric-se3", duration=0.1, start={"x": 0.3})
    assert len(steps) == 10
    for step in steps:
        assert isinstance(step, FlownStep)
        assert step.again(law, step.memory)[1].rotor_speeds.tobytes() == step.rotor_speeds.tobytes()


def test_the_command_prints_the_table_and_the_failures(ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "the same step twice" in ran("check-controller", "geometric-se3", "--only", "memory").out
    made = colibri.load_controller("geometric-se3")

    def stiff(table: Any, vehicle: Vehicle, clock: Any) -> Any:
        law = made(table, vehicle, clock)
        monkeypatch.setattr(law, "preview", (10_000, 1))
        return law

    monkeypatch.setattr("colibri.conformance.subject.load_controller", lambda _name: stiff)
    failed, see = ran("check-controller", "geometric-se3", "--only", "interface", "--quiet", code=1).out.splitlines()
    assert failed == (
        "FAILED  interface: control_interval_us, preview: preview is tuple, not Preview(interval_us, samples)"
    )
    assert shlex.split(see)[:3] == ["see", "python", "-c"]


def test_a_law_that_cannot_be_built_is_no_verdict() -> None:
    def broken(*_: Any) -> Any:
        raise ZeroDivisionError("by zero")

    with pytest.raises(Error, match="controller broken cannot be built: ZeroDivisionError: by zero"):
        colibri.check_controller(broken)


def test_a_notebook_shows_table_and_failures() -> None:
    found = tried(laws.Half, "interface")
    page = found._repr_html_()
    assert "<td>failed</td>" in page
    assert "charge_ah without with_charge" in page
    assert "charge_ah without with_charge" in str(found)
