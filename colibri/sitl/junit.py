"""What a failed test's flights add to JUnit XML: a text and pictures in system-out."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree.ElementTree import Element

import pytest
from _pytest.junitxml import xml_key

SAID = "sitl_said"
"""Attribute of a teardown's report that holds the text."""


def attachments(kept: list[Path], folder: Path) -> str:
    """Return lines for the pictures of kept flights: relative to `folder`, for GitLab, then absolute, for Jenkins."""
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
