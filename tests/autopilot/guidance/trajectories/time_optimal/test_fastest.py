"""The fastest flights: within the limits, above the floor, through every point, smooth, nearly as fast as can be."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.csv_table import TrackFileError
from colibri.autopilot.guidance.trajectories.fitting import ROUNDING_M, fit
from colibri.autopilot.guidance.trajectories.loading import LoadedTrack, load_track
from colibri.autopilot.guidance.trajectories.reach import Reach, exact_motion, times
from colibri.autopilot.guidance.trajectories.registry import TrackError
from colibri.autopilot.guidance.trajectories.time_optimal.fastest import fastest
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.autopilot.guidance.trajectories.waypoint_file import read_waypoints
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle

LINE = "x,y,z\n0,0,3\n30,0,3\n"
TURN = "x,y,z,yaw\n0,0,0,0\n12,0,1,0\n12,2,1,90\n0,2,0,90\n"


@cache
def reach() -> Reach:
    return Reach(load_vehicle("hummingbird"), load_profile("flight"), exact_drag=True)


def loaded(folder: Path, text: str, options: str = "") -> LoadedTrack:
    (folder / "points.csv").write_text(text, encoding="utf-8")
    vehicle, profile = load_vehicle("hummingbird"), load_profile("flight")
    return load_track(f"waypoints:{folder / 'points.csv'},speed=max{options}", vehicle, profile)


def beyond(flown: LoadedTrack, margin: float) -> float:
    motion = exact_motion(flown.track)
    demands = reach().demands(motion, reach().charge_of(motion))
    return max(float(demand.beyond(margin).max()) for demand in demands)


@pytest.mark.long
def test_a_turn_from_the_floor_to_the_floor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.autopilot.guidance.trajectories.time_optimal.fastest._ITERATIONS", 25)
    flown = loaded(tmp_path, TURN)
    track, waypoints = flown.track, flown.track.waypoints
    assert waypoints is not None
    assert position(track, waypoints.times_s) == pytest.approx(waypoints.points_enu_m, abs=1e-9)
    assert position(track, times(track))[:, 2].min() >= -ROUNDING_M
    assert beyond(flown, 0.1) <= 0.0
    slow, _ = fit(read_waypoints(waypoints.path, 5.0), reach(), 0.0)
    assert track.duration_s < 0.75 * slow.duration_s
    assert track.yaw is not None
    assert track.yaw(track.clock(waypoints.times_s, 0)).derivative(0) == pytest.approx(np.radians([0, 0, 90, 90]))
    _is_smooth(flown)


def _is_smooth(flown: LoadedTrack) -> None:
    t: Array = np.arange(0.01, flown.track.duration_s - 0.01, 0.001)
    for axis in flown.track.position(flown.track.clock(t, 5)):
        for order in range(1, 5):
            steepest = np.abs(axis.derivative(order + 1)).max()
            assert np.abs(np.diff(axis.derivative(order))).max() <= 0.001 * steepest * 1.2


@pytest.mark.long
def test_more_margin_is_slower_and_the_same_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.autopilot.guidance.trajectories.time_optimal.fastest._ITERATIONS", 10)
    flown = [loaded(tmp_path, "x,y,z\n0,0,3\n4,0,3\n4,4,3\n", f",margin={margin}") for margin in (0.0, 0.3, 0.3)]
    assert beyond(flown[0], 0.0) <= 0.0
    assert beyond(flown[1], 0.3) <= 0.0
    assert flown[1].track.duration_s > 1.1 * flown[0].track.duration_s
    assert (exact_motion(flown[1].track).snap == exact_motion(flown[2].track).snap).all(), "bit for bit"


@pytest.fixture(scope="module")
def narrow_s(tmp_path_factory: pytest.TempPathFactory) -> float:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("colibri.autopilot.guidance.trajectories.time_optimal.fastest._ITERATIONS", 20)
        return loaded(tmp_path_factory.mktemp("narrow"), GATES.format("0,0,0")).track.duration_s


GATES = "x,y,z,width,height,facing\n0,0,3,0,0,0\n8,3,3,{}\n16,0,3,0,0,0\n"


@pytest.mark.parametrize(
    ("text", "options", "inside"),
    [
        (GATES.format("2,1,0"), "", lambda off: abs(off[0]) < 1e-9 and abs(off[1]) <= 0.9 and abs(off[2]) <= 0.45),
        pytest.param(
            "x,y,z\n0,0,3\n8,3,3\n16,0,3\n",
            ",tolerance=1",
            lambda off: 0.8 < np.linalg.norm(off) <= 0.9,
            marks=pytest.mark.long,
        ),
    ],
    ids=["window", "ball"],
)
def test_a_wide_waypoint_is_passed_where_it_is_fastest(
    text: str,
    options: str,
    inside: Callable[[Array], bool],
    narrow_s: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("colibri.autopilot.guidance.trajectories.time_optimal.fastest._ITERATIONS", 20)
    wide = loaded(tmp_path, text, options)
    assert wide.track.waypoints is not None
    assert inside(wide.track.waypoints.points_enu_m[1] - (8.0, 3.0, 3.0))
    assert position(wide.track, wide.track.waypoints.times_s) == pytest.approx(wide.track.waypoints.points_enu_m)
    assert beyond(wide, 0.1) <= 0.0
    assert wide.track.duration_s < 0.97 * narrow_s


def test_a_window_from_behind_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.autopilot.guidance.trajectories.time_optimal.fastest._ITERATIONS", 5)
    with pytest.raises(TrackError, match=r"points\.csv: window 2 would be flown through from behind: add a waypoint"):
        loaded(tmp_path, GATES.format("2,1,180"))


def test_a_waypoint_below_the_floor_is_refused(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(LINE, encoding="utf-8")
    with pytest.raises(TrackFileError, match=r"points\.csv: waypoint 1 is at 3 m, below the floor of 4 m"):
        fastest(read_waypoints(tmp_path / "points.csv", "max"), reach(), 4.0)
