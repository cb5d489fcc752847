"""Series reduced to what a figure shows: some points in place of many, and the same picture."""

from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from numpy.typing import NDArray

from colibri.analysis.figure_series import MAX_PATH_POINTS, MAX_POINTS, EveryNth, Extremes
from colibri.analysis.figures import Curve, Panel, TimeFigure, draw_times, draw_trajectory
from colibri.common.types import Array

HOUR = np.arange(450_000, dtype=np.float64) * 0.008
KINDS = [Extremes, EveryNth]
MAX_DIFFERENT = 0.005  # part of the pixels that may look different: where a curve's edge lies between two


def rows_of(count: int) -> Array:
    noise = np.random.default_rng(count).normal(size=count)
    return np.stack([np.arange(count, dtype=np.float64), noise, np.full(count, 7.0)], axis=1)


def reduced(kind: Any, rows: Array, most: int, part: int) -> Array:
    series = kind(rows.shape[1], len(rows), most)
    for first in range(0, len(rows), part):
        series.add(rows[first : first + part])
    points: Array = np.concatenate(series.points())
    return points


@pytest.mark.parametrize("kind", KINDS)
@given(count=st.integers(1, 300), part=st.integers(1, 100), half=st.integers(1, 20))
def test_points_do_not_depend_on_the_parts(kind: Any, count: int, part: int, half: int) -> None:
    rows, most = rows_of(count), 2 * half
    assert np.array_equal(reduced(kind, rows, most, part), reduced(kind, rows, most, count))


@pytest.mark.parametrize("kind", KINDS)
@given(count=st.integers(1, 300), part=st.integers(1, 100), half=st.integers(1, 20))
def test_points_are_thinned_only_beyond_the_limit(kind: Any, count: int, part: int, half: int) -> None:
    rows, most = rows_of(count), 2 * half
    points = reduced(kind, rows, most, part)
    if count <= most:
        assert np.array_equal(points, rows)
    assert min(count, most // 2) <= len(points) <= most + 2
    assert points[[0, -1], 0].tolist() == [0, count - 1]
    assert (np.diff(points[:, 0]) > 0).all()
    assert (points[:, 2] == 7.0).all()


@given(count=st.integers(1, 300), part=st.integers(1, 100))
def test_no_extreme_is_lost(count: int, part: int) -> None:
    """Of any stretch of spans, not of the whole alone."""
    rows = rows_of(count)
    points = reduced(Extremes, rows, 16, part)
    for first in range(0, len(points) - 1, 2):
        begin, end = points[first, 0], points[first + 1, 0]
        within = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= end), 1]
        assert sorted(points[first : first + 2, 1]) == [within.min(), within.max()]


def picture(figure: Figure) -> NDArray[np.uint8]:
    with BytesIO() as pixels:
        figure.savefig(pixels, format="rgba")
        return np.frombuffer(pixels.getvalue(), dtype=np.uint8).reshape(-1, 4)


def different(one: Figure, other: Figure) -> float:
    return float((np.ptp([picture(one), picture(other)], axis=0).max(axis=1) > 64).mean())


SHAPES: dict[str, Callable[[Array], Array]] = {
    "noise": lambda t: np.random.default_rng(0).normal(size=len(t)),
    "slow": lambda t: np.sin(t / 300.0),
    "fast": lambda t: np.sin(2.0 * t) * np.exp(-t / 1000.0),
    "rare": lambda t: np.where(np.arange(len(t)) % 100_000 == 70_000, 1.0, 0.0),
    "steps": lambda t: np.floor(t / 500.0) + 0.01 * np.sin(40.0 * t),
}


@pytest.mark.parametrize(
    ("shape", "held"),
    [
        *((shape, False) for shape in SHAPES),
        *((shape, True) for shape in ("steps",)),
        pytest.param("noise", True, marks=pytest.mark.long),
    ],
)
def test_an_hour_looks_the_same_over_time(shape: str, held: bool) -> None:
    rows: Array = np.stack([HOUR, SHAPES[shape](HOUR)], axis=1)
    description = TimeFigure("own", "own", ((Panel("x (m)", (Curve("x", "x", held=held),)),),))
    all_of_it, kept = (
        draw_times({"t": drawn[:, 0], "x": drawn[:, 1]}, description, "x")
        for drawn in (rows, reduced(Extremes, rows, MAX_POINTS, 1000))
    )
    assert different(all_of_it, kept) < MAX_DIFFERENT


@pytest.mark.long
def test_an_hour_looks_the_same_in_space() -> None:
    """Laps of 8 s at up to 6 m/s², each a little further on."""
    angle = 2.0 * np.pi * HOUR / 8.0
    path = np.stack([8.0 * np.sin(angle), 4.0 * np.sin(2.0 * angle), 3.0 + HOUR / 600.0], axis=1)
    rows: Array = np.hstack([path, path + 0.05])
    names = ("x", "y", "z", "x_ref", "y_ref", "z_ref")
    all_of_it, kept = (
        draw_trajectory(dict(zip(names, drawn.T, strict=True)), "x")
        for drawn in (rows, reduced(EveryNth, rows, MAX_PATH_POINTS, 1000))
    )
    assert different(all_of_it, kept) < MAX_DIFFERENT
