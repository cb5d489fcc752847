"""The marks of flight tests: their arguments, and what is wrong with one."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import pytest
from _pytest.junitxml import xml_key

from colibri.common.errors import unknown

ALIKE = 0.75  # similarity from which an unknown mark is taken for a typo


class Signature(NamedTuple):
    """The arguments of a mark, each with the option of `Setting` that it sets; `needed` of them are required."""

    options: Mapping[str, str]
    needed: int = 1
    meaning: str = ""  # default: of the first option

    @property
    def arguments(self) -> str:
        names = list(self.options)
        return ", ".join([*names[: self.needed], *(f"{name}=None" for name in names[self.needed :])])


MARKS = {
    "sitl": Signature({}, 0, "initial conditions by name, options of `colibri.sitl.Setting`"),
    "vehicle": Signature({"name": "vehicle"}),
    "feedback": Signature({"kind": "feedback"}),
    "wind": Signature({"wind": "wind", "turbulence": "turbulence"}),
    "seed": Signature({"number": "seed"}),
    "seeds": Signature({"first": "seed", "last": "seed"}, 2, "one flight for each seed"),
}


def signature(name: str) -> str:
    return f"{name}({MARKS[name].arguments or 'NAME=VALUE, ...'})"


def described(name: str) -> str:
    """Return a mark's signature and meaning, by the options of a flight's setting."""
    from colibri.common.spec import fields_of
    from colibri.sitl.backends.setting import Setting

    known, mark = fields_of(Setting), MARKS[name]
    meaning = mark.meaning or known[next(iter(mark.options.values()))].option.help
    return f"{signature(name)}: {meaning}" if mark.options else f"{signature(name)}: {meaning}: {', '.join(known)}"


def setting_values(mark: pytest.Mark) -> dict[str, Any]:
    options = MARKS[mark.name].options
    return {options.get(name, name): value for name, value in arguments(mark).items()}


def arguments(mark: pytest.Mark, of: str = "") -> dict[str, Any]:
    """Return the arguments of a mark by name; a failure begins with `of`."""
    known = MARKS[mark.name]
    names = list(known.options)
    typo = next((name for name in mark.kwargs if name not in names), None) if names else None
    if typo is not None:
        pytest.fail(f"{of}mark {mark.name}: {unknown('argument', typo, names)}", pytrace=False)
    values = {**dict(zip(names, mark.args, strict=False)), **mark.kwargs}
    if len(mark.args) > len(names) or not set(names[: known.needed]) <= set(values):
        pytest.fail(f"{of}mark is {signature(mark.name)}, not {written(mark)}", pytrace=False)
    return values


def written(mark: pytest.Mark) -> str:
    return f"{mark.name}({', '.join([*map(repr, mark.args), *(f'{k}={v!r}' for k, v in mark.kwargs.items())])})"


def without_effect(item: pytest.Item, fixtures: Iterable[str], registered: list[str]) -> str | None:
    """Return what is wrong with a test's marks: one without its fixture, or a typo."""
    used = set(fixtures)
    if used & {"sitl", "sitl_fleet"}:
        return next(filter(None, (_typo(mark, registered) for mark in item.iter_markers())), None)
    for mark in item.own_markers:
        of_others = registered.count(mark.name) > 1
        if mark.name in MARKS and not of_others and ("request" not in used or mark.name == "seeds"):
            return f"mark {mark.name} has no effect: {item.name} uses neither fixture sitl nor sitl_fleet"
    return None


def _typo(mark: pytest.Mark, registered: list[str]) -> str | None:
    if mark.name in registered or not (mark.args or mark.kwargs):
        return None
    from colibri.common.spec import fields_of
    from colibri.sitl.backends.setting import Setting

    if get_close_matches(mark.name, MARKS, 1, ALIKE):
        return unknown("mark", mark.name, MARKS)
    option = next(iter(get_close_matches(mark.name, fields_of(Setting), 1, ALIKE)), None)
    return option and f'unknown mark "{mark.name}" (did you mean "sitl({option}=...)"?)'


FLOWN = "sitl_flown"  # attribute of a report that holds the flights of its test


class Summary:
    def __init__(self, began_s: float) -> None:
        self._began_s = began_s
        self.flights = 0
        self._simulated_s = 0.0
        self._outcomes: dict[str, tuple[str, str]] = {}

    def add(self, test: str, outcome: str, flown: Mapping[str, Any] | None) -> None:
        if flown is None:
            return
        self.flights += flown["flights"]
        self._simulated_s += flown["simulated_s"]
        self._outcomes[test] = (outcome, " ".join(flown["sha256"]))

    def lines(self) -> list[str]:
        """Return a sorted line per test: name, outcome, hashes."""
        return [f"{test} {outcome} {hashes}" for test, (outcome, hashes) in sorted(self._outcomes.items())]

    def verdict(self) -> str:
        return sha256("\n".join(self.lines()).encode()).hexdigest()[:16]

    def line(self, now_s: float) -> str:
        wall_s = now_s - self._began_s
        rate = self._simulated_s / wall_s
        flown = f"{self.flights} flights, {self._simulated_s:.1f} s simulated in {wall_s:.1f} s of wall-clock time"
        return f"sitl: {flown}, {rate:.1f} sim-s per wall-s, verdict {self.verdict()}"


SAID = "sitl_said"  # attribute of a teardown's report that holds the text


def attachments(kept: list[Path], folder: Path) -> str:
    """Return lines for the pictures of kept flights: relative to `folder` (GitLab), then absolute (Jenkins)."""
    from colibri.sitl.flight_record import FIGURE

    pictures = [place / FIGURE for place in kept if (folder / place / FIGURE).exists()]
    places = [*pictures, *(folder / picture for picture in pictures if not picture.is_absolute())]
    return "".join(f"\n[[ATTACHMENT|{place}]]" for place in places)


@contextmanager
def in_system_out(config: pytest.Config, report: pytest.TestReport) -> Iterator[None]:
    """Add a report's text to the test case that the block completes."""
    xml, said = config.stash.get(xml_key, None), getattr(report, SAID, "")
    if xml is None or not said:
        yield
        return
    reporter = xml.node_reporter(report)
    yield
    case = reporter.to_xml()
    out = case.find("system-out")
    if out is None:
        out = Element("system-out")
        case.append(out)
    out.text = "\n".join([said, *filter(None, [out.text])])
