from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.interface import Horizon, Preview
from colibri.autopilot.control.profile import References
from colibri.autopilot.guidance.trajectories.planner import Planner, start_yaw
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import DURATION_S, THESIS_TRACKS, position
from colibri.common.types import Array

INTERVAL_S = 0.4
SAMPLES = 250
FINE_S = 1e-3
PREVIEW = Preview(interval_us=8_000, samples=21)
KINDS: tuple[References, ...] = ("by-differences", "by-formula")
ENDLESS = (
    *("hover", "hover:x=1,y=2,height=3,yaw=90", "circle", "circle:radius=3,speed=4,yaw=fixed"),
    *("lemniscate", "lemniscate:lap=5", "lemniscate:size=2,yaw=fixed"),
)
WAYPOINTS = "0,0,1,0\n3,0,2,2\n3,4,2,4\n0,-1,1,7\n"


def waypoint_file(folder: Path, text: str = WAYPOINTS) -> str:
    """Write waypoints, with times if there are four columns; return the name of the track."""
    header = ("x", "y", "z", "t")[: text.partition("\n")[0].count(",") + 1]
    (folder / "points.csv").write_text(f"{','.join(header)}\n{text}", encoding="utf-8")
    return f"waypoints:{folder / 'points.csv'}"


def horizon_from(name: str, time_us: int, samples: int, kind: References = "by-differences") -> Horizon:
    return Planner(track(name), kind, Preview(round(INTERVAL_S * 1e6), samples)).horizon(time_us)


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


@pytest.mark.parametrize("name", THESIS_TRACKS)
def test_velocity_is_the_backward_difference(name: str) -> None:
    horizon = horizon_from(name, 0, SAMPLES + 1)
    steps = np.diff(horizon.position_enu_m, axis=0)
    assert horizon.velocity_enu_m_s[1:] * INTERVAL_S == pytest.approx(steps, abs=1e-8)
    assert horizon.velocity_enu_m_s[0] == pytest.approx(horizon.velocity_enu_m_s[1])


def differences(values: Array) -> Array:
    """Central differences of eighth order, without the four samples at either end."""
    weights = ((1, 4.0 / 5.0), (2, -1.0 / 5.0), (3, 4.0 / 105.0), (4, -1.0 / 280.0))
    last = len(values)
    rise = sum(weight * (values[4 + k : last - 4 + k] - values[4 - k : last - 4 - k]) for k, weight in weights)
    return np.asarray(rise) / FINE_S


@pytest.mark.parametrize("begin_us", [0, 1_500_000, 20_000_000])
@pytest.mark.parametrize("name", [*THESIS_TRACKS, *ENDLESS, "waypoints"])
def test_formulas_are_derivatives_of_each_other(tmp_path: Path, name: str, begin_us: int) -> None:
    """Between the samples where a path leaves its first point and comes to its last, and its yaw is held."""
    flown = track(waypoint_file(tmp_path)) if name == "waypoints" else track(name)
    horizon = Planner(flown, "by-formula", Preview(round(FINE_S * 1e6), 2000)).horizon(begin_us)
    for lower, higher in ((0, 1), (1, 2), (2, 3), (3, 4), (5, 6), (6, 7)):
        given = horizon[higher][4:-4]
        away = np.convolve(np.hypot(*horizon.velocity_enu_m_s[:, :2].T) < 0.02, np.ones(9), "valid") > 0
        checked = ~away if lower >= 5 else np.full_like(away, True)
        scale = 1.0 + np.abs(given).max(initial=0.0)
        np.testing.assert_allclose(differences(horizon[lower])[checked] / scale, given[checked] / scale, 1e-6, 1e-6)


@pytest.mark.parametrize("name", ENDLESS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_track_without_end_goes_on(name: str, kind: References) -> None:
    planner, flown = Planner(track(name), kind, PREVIEW), track(name)
    for time_us in (3_600_000_000, 0, 4_088_000, 4_096_000, 4_090_123, 99_000_000, 100_008_000):
        horizon, fresh = planner.horizon(time_us), Planner(track(name), kind, PREVIEW).horizon(time_us)
        t: Array = 8e-3 * np.arange(time_us // 8_000, time_us // 8_000 + 21, dtype=np.float64)
        assert all((one == other).all() for one, other in zip(horizon, fresh, strict=True))
        assert horizon.position_enu_m == pytest.approx(position(flown, t), abs=1e-9)
        if kind == "by-formula":
            assert horizon.velocity_enu_m_s == pytest.approx(position(flown, t, 1), abs=1e-9)
        elif time_us:
            before = position(flown, t - 8e-3)
            assert horizon.velocity_enu_m_s == pytest.approx((position(flown, t) - before) / 8e-3, abs=1e-8)


@pytest.mark.parametrize("name", ENDLESS)
def test_yaw_of_a_track_without_end(name: str) -> None:
    by_formula, by_differences = (Planner(track(name), kind, Preview(8_000, 2_000)).horizon(0) for kind in KINDS[::-1])
    assert (by_formula.yaw_rad == by_differences.yaw_rad).all()
    assert not by_differences.yaw_rate_rad_s.any()
    wanted = {"hover": 0.0, "hover:x=1,y=2,height=3,yaw=90": np.pi / 2.0}.get(name, 0.0)
    vx, vy = by_formula.velocity_enu_m_s[:, :2].T
    along = np.arctan2(vy, vx) if name in ("circle", "lemniscate", "lemniscate:lap=5") else wanted
    assert np.cos(by_formula.yaw_rad - along) == pytest.approx(1.0)
    assert np.abs(np.diff(by_formula.yaw_rad)).max() < 0.1
    assert -np.pi < by_formula.yaw_rad[0] <= np.pi


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("interval_us", [8_000, 30_000, 400_000])
def test_after_waypoints_it_rests_at_the_last(tmp_path: Path, interval_us: int, kind: References) -> None:
    """Also where the end lies between two samples; yaw is that of the last sample that moved."""
    planner = Planner(track(waypoint_file(tmp_path)), kind, Preview(interval_us, 21))
    for time_us in (7_000_001 + interval_us, 100_000_000, 3_600_000_000):
        horizon = planner.horizon(time_us)
        assert horizon.position_enu_m == pytest.approx(np.tile([0.0, -1.0, 1.0], (21, 1)), abs=1e-12)
        for rate in (*horizon[1:5], *horizon[6:]):
            assert not rate.any()
        assert np.ptp(horizon.yaw_rad) == 0.0


@pytest.mark.parametrize("name", [*THESIS_TRACKS, *ENDLESS, "waypoints"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_planner_returns_the_reference_of_an_instant(tmp_path: Path, name: str, kind: References) -> None:
    flown = track(waypoint_file(tmp_path)) if name == "waypoints" else track(name)
    planner = Planner(flown, kind, Preview(100_000, 1))
    times_us = range(0, 130_000_000, 700_000)
    handed = np.concatenate([planner.horizon(time_us).position_enu_m for time_us in times_us])
    assert handed == pytest.approx(position(flown, np.array(times_us) / 1e6), abs=1e-9)


def test_yaw_at_rest_is_that_of_the_departure(tmp_path: Path) -> None:
    """Snap is the first derivative that a track from rest has; what looks along it does not turn as it sets off."""
    flown = track(waypoint_file(tmp_path))
    horizon = Planner(flown, "by-formula", Preview(1_000, 200)).horizon(0)
    sx, sy, _ = horizon.snap_enu_m_s4[0]
    assert horizon.yaw_rad[0] == pytest.approx(np.arctan2(sy, sx) % (2.0 * np.pi))
    assert start_yaw(flown, "by-formula") == horizon.yaw_rad[0]
    assert np.abs(np.diff(horizon.yaw_rad)).max() < 0.1
    still = np.hypot(*horizon.velocity_enu_m_s[:, :2].T) < 1e-3
    assert still[:3].all()
    assert not horizon.yaw_rate_rad_s[still].any()
    assert not horizon.yaw_acceleration_rad_s2[still].any()


@pytest.mark.parametrize("kind", KINDS)
def test_straight_up_yaw_is_held(tmp_path: Path, kind: References) -> None:
    horizon = Planner(track(waypoint_file(tmp_path, "1,1,0\n1,1,5\n")), kind, Preview(100_000, 60)).horizon(0)
    wanted = 0.0 if kind == "by-formula" else np.pi / 4.0 + np.pi / 2.0
    assert horizon.yaw_rad == pytest.approx(np.full(60, wanted))


def test_there_and_back_yaw_turns_by_half_a_turn_at_once(tmp_path: Path) -> None:
    back = track(waypoint_file(tmp_path, "0,0,2\n4,0,2\n0,0,2\n"))
    steps = np.abs(np.diff(Planner(back, "by-formula", Preview(8_000, 1_500)).horizon(0).yaw_rad))
    assert steps.max() == pytest.approx(np.pi)
    assert np.count_nonzero(steps > 1e-6) == 1


def test_a_flight_starts_with_the_first_yaw() -> None:
    assert start_yaw(track("line"), "by-differences") == pytest.approx(np.arctan2(-2.0, 1.0) + np.pi / 2)
    assert start_yaw(track("line"), "by-formula") == pytest.approx(np.pi / 4)


def test_a_horizon_begins_with_the_sample_it_lies_in() -> None:
    everything = horizon_from("spiral", 0, SAMPLES + 1)
    for time_us, sample in ((0, 0), (399_999, 0), (400_000, 1), (700_000, 1), (99_999_999, 249)):
        horizon = horizon_from("spiral", time_us, 2)
        assert horizon.position_enu_m == pytest.approx(everything.position_enu_m[sample : sample + 2])


@pytest.mark.parametrize("name", ["lemniscate", "circle:radius=3,speed=4"])
def test_between_two_instants_references_are_the_tracks(name: str) -> None:
    fine = Planner(track(name), "by-formula", Preview(1_000, 1))
    coarse = Planner(track(name), "by-formula", PREVIEW)
    assert np.array_equal(coarse.horizon_at(800_000, 8_000).position_enu_m, coarse.horizon(800_000).position_enu_m)
    between, there = coarse.horizon_at(1_207_000, 8_000), fine.horizon(1_207_000)
    for column, exact, within in zip(between, there, (1e-9, 1e-8, 1e-5, 1e-2, 1.0, 1e-5, 1e-3, 1.0), strict=True):
        assert column[0] == pytest.approx(exact[0], abs=within)
