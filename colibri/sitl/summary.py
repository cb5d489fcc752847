"""The summary of a run's flights, and their text and pictures in JUnit XML."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import pytest
from _pytest.junitxml import xml_key

FLOWN = "sitl_flown"
"""Attribute of a report that holds the flights of its test."""


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


SAID = "sitl_said"
"""Attribute of a teardown's report that holds the text."""


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
