"""Tracks and how they are sampled."""

import numpy as np
import pytest

from autopilot.controller import Horizon, Preview
from autopilot.planner import plan, start_yaw
from autopilot.profile import References
from autopilot.tracks import DURATION_S, TRACKS, TrackError, position, track

INTERVAL_S = 0.4
SAMPLES = 250
KINDS: tuple[References, ...] = ("by-differences", "by-formula")


def horizon_from(name: str, time_us: int, samples: int, kind: References = "by-differences") -> Horizon:
    return plan(track(name), kind, Preview(round(INTERVAL_S * 1e6), samples)).horizon(time_us)


def test_the_five_tracks() -> None:
    assert list(TRACKS) == ["spiral", "expanding-spiral", "line", "wave", "crown"]
    with pytest.raises(TrackError, match="unknown track loop: choose spiral"):
        track("loop")


@pytest.mark.parametrize(
    ("name", "start", "end"),
    [
        ("spiral", (2.0, 0.0, 2.0), (-2.0, 0.0, 5.0)),
        ("expanding-spiral", (2.0, 0.0, 2.0), (-22.0, 0.0, 5.0)),
        ("line", (1.0, -2.0, 2.0), (11.0, 8.0, 5.0)),
        ("wave", (2.0, 0.0, 2.0), (-2.0, 200.0, 5.0)),
        ("crown", (2.0, 0.0, 2.0), (-2.0, 0.0, 2.0 + 1.5 * np.sin(100.0))),
    ],
)
def test_where_a_track_begins_and_ends(name: str, start: tuple[float, ...], end: tuple[float, ...]) -> None:
    ends = position(track(name), np.array([0.0, DURATION_S]))
    assert ends == pytest.approx(np.array([start, end]), abs=1e-12)


@pytest.mark.parametrize("name", TRACKS)
def test_velocity_is_the_backward_difference(name: str) -> None:
    horizon = horizon_from(name, 0, SAMPLES + 1)
    steps = np.diff(horizon.position_enu_m, axis=0)
    assert horizon.velocity_enu_m_s[1:] * INTERVAL_S == pytest.approx(steps, abs=1e-8)
    assert horizon.velocity_enu_m_s[0] == pytest.approx(horizon.velocity_enu_m_s[1])


@pytest.mark.parametrize("name", TRACKS)
def test_by_formula_each_quantity_is_the_derivative_of_the_one_before(name: str) -> None:
    """Central differences, whose error is of second order in the interval."""
    interval_s = 1e-3
    horizon = plan(track(name), "by-formula", Preview(round(interval_s * 1e6), 2000)).horizon(20_000_000)
    quantities = [*horizon[:4], horizon.yaw_rad, horizon.yaw_rate_rad_s]
    for lower, higher in ((0, 1), (1, 2), (2, 3), (4, 5)):
        differences = (quantities[lower][2:] - quantities[lower][:-2]) / (2.0 * interval_s)
        assert differences == pytest.approx(quantities[higher][1:-1], abs=1e-5)


@pytest.mark.parametrize("name", TRACKS)
def test_by_formula_is_what_differences_come_near(name: str) -> None:
    differences, formula = (horizon_from(name, 0, SAMPLES + 1, kind) for kind in KINDS)
    assert formula.position_enu_m == pytest.approx(differences.position_enu_m, abs=1e-12)
    midway = 0.5 * (formula.velocity_enu_m_s[1:] + formula.velocity_enu_m_s[:-1])
    assert differences.velocity_enu_m_s[1:] == pytest.approx(midway, abs=0.03)
    assert np.abs(formula.yaw_rad - differences.yaw_rad)[1:].max() < 0.1


def test_a_flight_starts_with_the_first_yaw() -> None:
    assert start_yaw(track("line"), "by-differences") == pytest.approx(np.arctan2(-2.0, 1.0) + np.pi / 2)
    assert start_yaw(track("line"), "by-formula") == pytest.approx(np.pi / 4)


@pytest.mark.parametrize("name", TRACKS)
def test_yaw_points_along_the_track_and_never_jumps(name: str) -> None:
    horizon = horizon_from(name, 0, SAMPLES + 1)
    vx, vy = horizon.velocity_enu_m_s[1:, 0], horizon.velocity_enu_m_s[1:, 1]
    assert np.cos(horizon.yaw_rad[1:] - np.arctan2(vy, vx)) == pytest.approx(np.ones(SAMPLES), abs=1e-12)
    assert np.abs(np.diff(horizon.yaw_rad)).max() < np.pi


def test_first_yaw_is_the_tangent_of_a_circle() -> None:
    assert horizon_from("line", 0, 1).yaw_rad[0] == pytest.approx(np.arctan2(-2.0, 1.0) + np.pi / 2)


def test_a_horizon_begins_with_the_sample_it_lies_in() -> None:
    everything = horizon_from("spiral", 0, SAMPLES + 1)
    for time_us, sample in ((0, 0), (399_999, 0), (400_000, 1), (700_000, 1), (99_999_999, 249)):
        horizon = horizon_from("spiral", time_us, 2)
        assert horizon.position_enu_m == pytest.approx(everything.position_enu_m[sample : sample + 2])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("time_us", [100_000_000, 100_400_000, 3_600_000_000])
def test_after_its_end_a_track_holds_its_last_point(time_us: int, kind: References) -> None:
    horizon = horizon_from("wave", time_us, 2, kind)
    assert horizon.position_enu_m[1] == pytest.approx([-2.0, 200.0, 5.0])
    assert horizon.velocity_enu_m_s[1] == pytest.approx([0.0, 0.0, 0.0])
