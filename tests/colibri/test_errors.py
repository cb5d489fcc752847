"""Errors: one base above all that a user may see, one a package, and nobody lists them by hand."""

import ast
import builtins
from functools import cache
from pathlib import Path

import pytest

import colibri
from colibri.autopilot.control.registry import DecisionError
from colibri.common.errors import Error, InFlightError
from colibri.flights.fly import FlightError
from colibri.mavlink.links.link import LinkError
from colibri.plant.physics.start import IntegrationError
from colibri.sitl.stepping import NotInTimeError
from tests.support.commands import Refused

SHIPPED = Path(colibri.__file__).parent
PACKAGES = {"autopilot": "AutopilotError", "mavlink": "MavlinkError", "plant": "PlantError", "sitl": "SitlError"}
INSIDE = {
    "NoEffectWarning": "a warning, which ends nothing",
    "Refused": "a setpoint that is not flown is counted",
    "_CompiledElsewhereError": "a kernel is interpreted instead, in the same file",
    "NakError": "a refusal of the file service, answered by it",
}
"""Exceptions that are no error for a user."""


@cache
def sources() -> list[tuple[Path, ast.Module]]:
    paths = [path for link in sorted(SHIPPED.iterdir()) for path in link.rglob("*.py")]  # rglob follows no links below
    return [
        (path.relative_to(SHIPPED), ast.parse(path.read_text(encoding="utf-8")))
        for path in [*SHIPPED.glob("*.py"), *paths]
    ]


def names(node: ast.expr | None) -> list[str]:
    if isinstance(node, ast.BinOp):
        return names(node.left) + names(node.right)
    elements = node.elts if isinstance(node, ast.Tuple) else [] if node is None else [node]
    return [each.attr if isinstance(each, ast.Attribute) else getattr(each, "id", "") for each in elements]


@cache
def exceptions() -> dict[str, tuple[str, set[str]]]:
    """Return each exception class that is shipped: its file, and the names of all that it derives from."""
    classes: dict[str, tuple[str, list[str]]] = {}
    for path, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):  # FTP has an enumeration Error, too: of one name all bases count
                bases = [name for base in node.bases for name in names(base)]
                classes[node.name] = (str(path), classes.get(node.name, ("", []))[1] + bases)

    def above(name: str) -> set[str]:
        found: set[str] = set()
        left = [name]
        while left:
            bases = classes.get(left.pop(), ("", []))[1]
            left += [base for base in bases if base not in found]
            found.update(bases)
        return found

    def raises(name: str) -> bool:
        known = getattr(builtins, name, None)
        return isinstance(known, type) and issubclass(known, BaseException)

    return {
        name: (path, above(name)) for name, (path, _) in classes.items() if any(raises(base) for base in above(name))
    }


def test_every_exception_that_a_user_may_see_is_an_error() -> None:
    found = exceptions()
    assert len(found) > 25
    assert {name for name, (_, above) in found.items() if "Error" not in above and name != "Error"} == INSIDE.keys()


def test_each_package_has_one_base() -> None:
    for name, (path, above) in exceptions().items():
        base = PACKAGES.get(path.partition("/")[0])
        if base and name not in ("Error", base, *INSIDE):
            assert base in above, f"{path}: {name}"


def test_errors_in_flight_and_of_tests_have_a_second_base() -> None:
    assert issubclass(DecisionError, InFlightError)
    assert issubclass(IntegrationError, InFlightError)
    assert issubclass(NotInTimeError, AssertionError)


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [(FlightError("nan", 1, said=False), 1, "nan; logs are in {out}"), (LinkError("no way"), 2, "no way")],
)
def test_only_a_flight_that_began_names_its_logs(
    error: Error, code: int, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("colibri.cli.flying.fly_plan", fail)
    assert refused("fly", "hover", "--quiet", "--out", tmp_path, code=code) == line.format(out=tmp_path)
