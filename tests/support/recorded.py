"""Flights as they were recorded, and the tables of flights."""

from pathlib import Path

import numpy as np
import pytest

from colibri.analysis.recording import COLUMNS
from colibri.common.process.lifecycle import nudge_m
from colibri.common.types import Array

REFERENCE = Path(__file__).parents[1] / "reference"
begins_as_recorded = pytest.mark.skipif(nudge_m() != 0.0, reason="compares with a flight that began at its start")
"""COLIBRI_NUDGE_M moves the start further than these tests permit."""


def rows(path: Path) -> dict[str, Array]:
    header = path.read_text(encoding="utf-8").partition("\n")[0].split(",")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    return dict(zip(header, table.T, strict=True))


def reference(track: str) -> dict[str, Array]:
    return rows(REFERENCE / f"{track}.csv")


def max_difference(flown: dict[str, Array], wanted: dict[str, Array], columns: tuple[str, ...]) -> float:
    assert set(columns) <= set(COLUMNS)
    return float(max(np.abs(flown[column] - wanted[column]).max() for column in columns))
