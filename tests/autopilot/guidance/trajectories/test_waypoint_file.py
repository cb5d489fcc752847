from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from colibri.autopilot.guidance.trajectories.csv_table import TrackFileError
from colibri.autopilot.guidance.trajectories.registry import TrackError, track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints, read_waypoints
from tests.support.refusals import refusal_of


def write(folder: Path, text: str) -> Path:
    path = folder / "points.csv"
    path.write_text(text, encoding="utf-8")
    return path


def read(folder: Path, text: str, speed_m_s: float | None = None) -> Waypoints:
    return read_waypoints(write(folder, text), speed_m_s)


def test_columns_in_any_order(tmp_path: Path) -> None:
    waypoints = read(tmp_path, "\ufeffyaw, z,t,y,x\r\n350,3,0,2,1\r\n\r\n10, 6,4.5,5,4\r\n")
    assert waypoints.points_enu_m == pytest.approx(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    assert waypoints.times_s == pytest.approx([0.0, 4.5])
    assert waypoints.yaw_rad == pytest.approx(np.radians([350.0, 370.0])), "the shorter way round"


@pytest.mark.parametrize(("speed", "times_s"), [(None, [0.0, 3.0, 5.0, 9.0]), (1.0, [0.0, 6.0, 10.0, 18.0])])
def test_times_from_a_speed_halve_it_on_the_end_legs(tmp_path: Path, speed: float | None, times_s: list[float]) -> None:
    waypoints = read(tmp_path, "x,y,z\n0,0,0\n3,0,0\n3,4,0\n3,4,4\n", speed)
    assert waypoints.times_s == pytest.approx(times_s)
    assert waypoints.yaw_rad is None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "line 1, column x: missing"),
        ("x,y\n", "line 1, column z: missing"),
        ("x,y,z,w\n", "line 1, column w: unknown: choose x, y, z, t, yaw, width, height, facing"),
        ("x,y,z,x\n", "line 1, column x: twice: choose x, y, z, t, yaw, width, height, facing"),
        ("x,y,z\n1,2,3\n", "line 2: the file ends, and a track needs two rows"),
        ("x,y,z\n1,2,3\n1,up,3\n", "line 3, column y: expected a number from -10000 to 10000, not 'up'"),
        ("x,y,z\n1,2,nan\n1,2,3\n", "line 2, column z: expected a number from -10000 to 10000, not 'nan'"),
        ("x,y,z\n1,2,3\n1,2,1e5\n", "line 3, column z: expected a number from -10000 to 10000, not '1e5'"),
        ("x,y,z\n1,2,3\n\n1,2\n", "line 4, column z: missing"),
        ("x,y,z\n1,2,3,4\n", "line 2, column 4: is not named in the header"),
        ("x,y,z,t\n1,2,3,1\n1,2,4,2\n", "line 2, column t: the first time must be 0, not 1"),
        ("x,y,z,t\n1,2,3,0\n1,2,4,2\n1,2,5,2\n", "line 4, column t: must be at least 0.05 s after the line before"),
        ("x,y,z,t\n1,2,3,0\n1,2,4,-2\n", "line 3, column t: must be at least 0.05 s after the line before"),
        ("x,y,z,t\n1,2,3,0\n1,2,4,3601\n", "line 3, column t: reached after 3601 s, and 3600 s is the longest"),
        ("x,y,z\n1,2,3\n1,2,3\n", "line 3, column x: less than 0.05 s from the line before at 2 m/s"),
        (
            "x,y,z,width\n1,2,3,1\n9,2,3,1\n",
            "line 1: columns width, height, facing belong together, without option tolerance",
        ),
        ("x,y,z\n1,2,3\n1,9000,3\n", "line 3, column x: reached after 8998 s, and 3600 s is the longest"),
    ],
)
def test_what_cannot_be_flown_is_one_line(tmp_path: Path, text: str, line: str) -> None:
    assert refusal_of(read, tmp_path, text) == f"{tmp_path / 'points.csv'}: {line}"
    with pytest.raises(TrackError, match=r"points\.csv: line"):
        track(f"waypoints:{tmp_path / 'points.csv'}")


def test_rounded_times_at_20_hz_are_accepted(tmp_path: Path) -> None:
    """0.15 - 0.1 is a little less than 0.05."""
    rows = [f"{0.05 * k:.2f},{0.001 * k},0,1\n" for k in range(100)]
    assert len(read(tmp_path, "t,x,y,z\n" + "".join(rows)).times_s) == 100


@pytest.mark.parametrize(("options", "what"), [("speed=2", "speed"), ("speed=max", "speed"), ("margin=0.1", "margin")])
def test_what_changes_times_is_refused_beside_them(tmp_path: Path, options: str, what: str) -> None:
    path = write(tmp_path, "x,y,z,t\n1,2,3,0\n1,2,4,2\n")
    with pytest.raises(TrackError, match=f"line 1, column t: sets the times: leave {what} out"):
        track(f"waypoints:{path},{options}")


def test_what_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_bytes(b"x,y,z\n\xff\xfe")
    with pytest.raises(TrackFileError, match=r"points\.csv: 'utf-8' codec can't decode"):
        read_waypoints(tmp_path / "points.csv", None)


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match="Is a directory"):
        track(f"waypoints:{tmp_path}")


@pytest.mark.parametrize("options", ["", "file=", "speed=3,file="])
def test_the_track_through_them(tmp_path: Path, options: str) -> None:
    path = write(tmp_path, "x,y,z,yaw\n0,0,1,0\n6,0,1,90\n6,8,1,180\n")
    flown = track(f"waypoints:{options}{path}")
    times_s = np.array([0.0, 6.0, 14.0]) * (2.0 / 3.0 if "speed" in options else 1.0)
    assert flown.duration_s == pytest.approx(times_s[-1])
    assert position(flown, times_s) == pytest.approx(np.array([[0.0, 0.0, 1.0], [6.0, 0.0, 1.0], [6.0, 8.0, 1.0]]))
    assert flown.yaw is not None
    t = np.linspace(0.0, times_s[-1], 29)
    smooth = CubicSpline(times_s, [0.0, np.pi / 2.0, np.pi], bc_type="clamped")
    for order in range(2):
        assert flown.yaw(flown.clock(t, order)).derivative(order) == pytest.approx(smooth(t, order), abs=1e-12)
