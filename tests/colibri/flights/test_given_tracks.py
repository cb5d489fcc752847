"""A track may be a function of time or an object: sampled, the same flight over each link and in campaigns."""

from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.autopilot.guidance.trajectories.samples_file import local_fit
from colibri.campaigns.flights import common_of, fly_point
from tests.support.campaigns import planned
from tests.support.refusals import refusal_of

W = 0.8


def circle(t: float) -> Any:
    return 2.0 * cos(W * t), 2.0 * sin(W * t), 2.0


def in_rows(t: float) -> Any:
    return np.array([circle(t), (-2.0 * W * sin(W * t), 2.0 * W * cos(W * t), 0.0)])


def whole(t: float) -> Any:
    return (*in_rows(t), np.array([-2.0 * W * W * cos(W * t), -2.0 * W * W * sin(W * t), 0.0]))


def in_words(t: float) -> Any:
    return dict(zip(("x", "x_dot", "x_ddot"), whole(t), strict=True))


def formula(t: Any) -> Any:
    angle = W * t
    return 2.0 * angle.cos(), 2.0 * angle.sin(), 2.0


class Positions:
    def position(self, t: float) -> Any:
        return circle(t)


class Whole(Positions):
    def velocity(self, t: float) -> Any:
        return whole(t)[1]

    def acceleration(self, t: float) -> Any:
        return whole(t)[2]


class Updated:
    def update(self, t: float) -> Any:
        return in_words(t)


class Helix(colibri.TrackOptions, frozen=True):
    radius: float = 2.0

    def track(self) -> colibri.Track:
        return colibri.Track(formula, duration_s=30.0)


BOTH = "velocity and acceleration follow from its positions"
GIVEN: tuple[tuple[Any, str], ...] = (
    (circle, f"track circle: {BOTH}"),
    (lambda t: [*circle(t)], f"track lambda: {BOTH}"),
    (in_rows, f"track in_rows: {BOTH}"),
    (whole, ""),
    (in_words, ""),
    (formula, ""),
    (Positions(), f"track Positions: {BOTH}"),
    (Whole(), ""),
    (Updated(), ""),
    (Helix(radius=3.0), ""),
    (Helix, ""),
    (colibri.Track(formula, duration_s=30.0), ""),
)
BAD: tuple[tuple[Any, str], ...] = (
    (5, "track int: expected a function of time"),
    (object(), "track object: expected a function of time"),
    (np.zeros((4, 3)), "track list: expected a function of time"),
    (lambda _t: (1.0, 2.0), "track lambda: at t = 0.000 s: ValueError: 3 finite numbers, not (1.0, 2.0): expected a"),
    (lambda t: (0.0, 0.0, 1.0 / (t - 0.2)), "track lambda: at t = 0.200 s: ZeroDivisionError"),
    (lambda _t: (0.0, 0.0, float("nan")), "track lambda: at t = 0.000 s: ValueError: 3 finite numbers"),
    (lambda _t: (0.0, 0.0, -3.0), "track samples:lambda is at -3.00 m after 0.01 s, below the floor of 0 m"),
    (lambda t: (circle(t), (9.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "lambda: line 3, column x: goes by"),
)


def flown(track: Any, **options: Any) -> colibri.Flight:
    start = {"x": 2.0, "z": 2.0, "vy": 2.0 * W}
    return colibri.fly(track, **({"duration": 1.0, "start": start} | options))


@pytest.mark.parametrize(("track", "note"), GIVEN)
def test_a_track_given_as_code_is_followed(track: Any, note: str) -> None:
    flight = flown(track)
    assert flight.report["track_note"] == note
    assert flight.report["track"].startswith("samples:")
    end = [flight.samples[f"{axis}_ref"][-1] for axis in "xyz"]
    assert np.allclose(end, circle(flight.samples["t"][-1]), atol=1e-6)
    assert flight.report["max_error_m"] < 0.1


@pytest.mark.parametrize(("track", "said"), BAD)
def test_code_that_gives_no_track_is_refused_in_one_line(track: Any, said: str) -> None:
    assert refusal_of(flown, track).startswith(said)


def test_the_same_flight_comes_of_each_link_and_of_campaigns(tmp_path: Path) -> None:
    flight = flown(circle)
    assert flown(circle, link="udp").sha256 == flight.sha256
    campaign = planned(
        fly={"duration": 1.0, "start": {"x": 2.0, "z": 2.0, "vy": 2.0 * W}}, grid={"track": [circle, whole]}
    )
    common = common_of(campaign)
    assert [fly_point(common, point).sha256 for point in campaign.points()] == [flight.sha256, flown(whole).sha256]
    saved = flight.save(tmp_path / "out")
    assert colibri.read_recording(saved).trajectory_sha256 == flight.sha256


@pytest.mark.parametrize("columns", ["t,x,y,z", "t,x,y,z,vx,vy,vz"])
def test_samples_without_derivatives_are_smoothed_and_it_is_said(tmp_path: Path, columns: str) -> None:
    chance = np.random.default_rng(1)
    path = tmp_path / "noisy.csv"
    rows = [[t, *(in_rows(t) + 1e-3 * chance.standard_normal((2, 3))).ravel()] for t in np.arange(0.0, 5.0, 0.02)]
    width = len(columns.split(","))
    lines = (",".join(f"{value:.4f}" for value in row[:width]) for row in rows)
    path.write_text("\n".join([columns, *lines]), encoding="utf-8")
    flight = flown(f"samples:{path}")
    assert "smoothed, by at most 0.00" in flight.report["track_note"]
    assert flight.report["max_error_m"] < 0.1


def test_a_local_fit_is_exact_for_its_own_degree() -> None:
    times_s = np.cumsum(np.array([0.0, 0.1, 0.05, 0.2, 0.1, 0.1, 0.3, 0.1, 0.1]))
    value, rate, curvature = local_fit(times_s, (times_s**4 - 2.0 * times_s)[:, None], 7)
    assert np.allclose(value[:, 0], times_s**4 - 2.0 * times_s, atol=1e-9)
    assert np.allclose(rate[:, 0], 4.0 * times_s**3 - 2.0, atol=1e-8)
    assert np.allclose(curvature[:, 0], 12.0 * times_s**2, atol=1e-6)
