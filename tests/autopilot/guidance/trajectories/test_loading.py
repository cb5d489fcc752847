from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.loading import LoadedTrack, load_track
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS, position
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle
from tests.support.foreign import FlyTheirs, example
from tests.support.refusals import refusal_of


def loaded(name: str, floor_m: float | None = None, vehicle: str = "hummingbird") -> LoadedTrack:
    return load_track(name, load_vehicle(vehicle), load_profile("flight"), floor_m)


def samples(step_s: float, *, yaw: bool = False) -> tuple[list[str], Array]:
    """Return header and rows of a lemniscate, 8 m wide in 6 s, and its positions."""
    t = np.arange(0.0, 6.0, step_s)
    flown = track("lemniscate")
    motion = np.concatenate([t[:, None], *(position(flown, t, order) for order in range(3))], axis=1)
    if yaw:
        motion = np.concatenate([motion, np.full((len(t), 1), 90.0)], axis=1)
    header = "t,x,y,z,vx,vy,vz,ax,ay,az" + (",yaw" if yaw else "")
    return [header, *(",".join(f"{value:.6f}" for value in row) for row in motion)], motion[:, 1:4]


def write(folder: Path, lines: list[str]) -> str:
    path = folder / "track.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"samples:{path}"


@pytest.mark.parametrize("name", [*THESIS_TRACKS, "hover", "lemniscate", "circle", "circle:radius=3,speed=4"])
def test_what_the_vehicle_can_fly_needs_no_word(name: str) -> None:
    assert loaded(name).note == ""


def test_a_formula_beyond_the_limits_is_flown_as_it_is_and_said() -> None:
    fast = loaded("lemniscate:lap=3")
    t = np.linspace(0.0, 3.0, 50)
    assert (position(fast.track, t) == position(track("lemniscate:lap=3"), t)).all()
    assert fast.note == (
        "track lemniscate:lap=3 exceeds the limits: thrust of 6.87 N a rotor, where 3.5 is the most; "
        "tilt of 75.4 degrees, where 70 is the most; body rate of 15.3 rad/s, where 10 is the most"
    )


@pytest.mark.parametrize(
    ("name", "floor_m", "why"),
    [
        ("hover:height=-1", None, "track hover:height=-1 is at -1.00 m after 0.00 s, below the floor of 0 m"),
        ("crown", 1.0, "track crown is at 0.50 m after 4.71 s, below the floor of 1 m"),
    ],
)
def test_a_track_below_the_floor_is_refused(name: str, floor_m: float | None, why: str) -> None:
    assert refusal_of(loaded, name, floor_m) == why


@pytest.mark.parametrize(
    ("floor_m", "vehicle"), [(-2.0, "hummingbird"), (-inf, "hummingbird"), (None, "hummingbird-thesis")]
)
def test_the_floor_may_be_lower_and_there_may_be_none(floor_m: float | None, vehicle: str) -> None:
    assert loaded("hover:height=-1", floor_m, vehicle).note == ""


@pytest.mark.parametrize("step_s", [0.02, 0.05, 0.1])
def test_samples_are_flown_as_they_are(tmp_path: Path, step_s: float) -> None:
    lines, places = samples(step_s)
    flown = loaded(write(tmp_path, lines)).track
    times_s: Array = step_s * np.arange(len(places), dtype=np.float64)
    assert position(flown, times_s) == pytest.approx(places, abs=1e-6)
    between = np.linspace(0.0, times_s[-1], 5000)
    for order, off in ((0, 1e-4), (1, 5e-3), (2, 0.2)):
        given = position(track("lemniscate"), between, order)
        np.testing.assert_allclose(position(flown, between, order), given, atol=off)
    for order in range(3):
        before, after = (position(flown, np.asarray(times_s[1:-1] + shift), order) for shift in (-1e-9, 1e-9))
        assert before == pytest.approx(after, abs=1e-5), "continuous to the acceleration"


def test_samples_may_say_which_way_to_look(tmp_path: Path) -> None:
    lines, _ = samples(0.05, yaw=True)
    flown = loaded(write(tmp_path, lines)).track
    assert flown.yaw is not None
    assert flown.yaw(flown.clock(np.array([1.234]), 0)).derivative(0) == pytest.approx([pi / 2.0])


@pytest.mark.parametrize(
    ("line", "column", "value", "why"),
    [
        (5, 5, "0", "line 6, column y: goes by 0.195 m from the line before, and vy by 0.0996: the columns disagree, "
         "or the rows are too far apart"),
        (5, 7, "9", "line 6, column vx: goes by -0.04 m/s from the line before, and ax by 0.208: the columns "
         "disagree, or the rows are too far apart"),
        (3, 0, "0.05", "line 4, column t: must be at least 0.001 s after the line before"),
        (3, 3, "", "line 4, column z: expected a number from -10000 to 10000, not ''"),
    ],
)  # fmt: skip
def test_samples_that_contradict_are_refused(tmp_path: Path, line: int, column: int, value: str, why: str) -> None:
    lines, _ = samples(0.05)
    cells = lines[line].split(",")
    cells[column] = value
    lines[line] = ",".join(cells)
    assert refusal_of(track, write(tmp_path, lines)) == f"{tmp_path / 'track.csv'}: {why}"


@pytest.mark.parametrize(
    ("header", "unused"),
    [
        ("Time,p_x,p_y,p_z,v_x,v_y,v_z,a_lin_x,a_lin_y,a_lin_z,psi", ""),
        ("t_s,pos_x,pos_y,pos_z,x_dot,y_dot,z_dot,ax_m_s2,ay_m_s2,az_m_s2,q_w", "columns not used: q_w"),
    ],
)
def test_samples_of_planners_are_read(tmp_path: Path, header: str, unused: str) -> None:
    lines, _ = samples(0.05)
    given = [f"{line},1.5" for line in lines[1:]]
    plain, renamed = loaded(write(tmp_path, lines)), loaded(write(tmp_path, [header, *given]))
    assert unused in renamed.note
    t = np.linspace(0.0, 2.0, 50)
    assert position(renamed.track, t).tolist() == position(plain.track, t).tolist()
    if renamed.track.yaw is not None:
        assert renamed.track.yaw(renamed.track.clock(t, 0)).derivative(0) == pytest.approx(1.5)


@pytest.mark.parametrize(("digits", "said"), [(2, True), (6, False)])
def test_rounded_samples_are_noticed(tmp_path: Path, digits: int, said: bool) -> None:
    lines, _ = samples(0.02)
    rounded = [",".join(f"{float(cell):.{digits}f}" for cell in line.split(",")) for line in lines[1:]]
    note = loaded(write(tmp_path, [lines[0], *rounded])).note
    assert ("rounding makes accelerations of up to" in note) is said
    assert "give more digits, or only positions" in note or not said


EXAMPLE = example("tracks.md")


def test_the_example_of_the_docs_flies(fly_theirs: FlyTheirs, tmp_path: Path) -> None:
    assert fly_theirs(EXAMPLE, "helix:radius=3,climb=0.2", "--duration", "4") == (0, "")
    rows = np.genfromtxt(tmp_path / "out" / "flight.csv", delimiter=",", names=True)
    assert np.hypot(rows["x_ref"], rows["y_ref"]) == pytest.approx(3.0)
    assert rows["z_ref"] == pytest.approx(1.0 + 0.2 * rows["t"])


def test_a_foreign_track_may_return_constants(fly_theirs: FlyTheirs) -> None:
    level = EXAMPLE.replace("1.0 + self.climb * t", "2").replace("duration_s=60.0", "lambda t: 0.5, 60.0")
    assert fly_theirs(level, "helix:radius=3", "--link", "direct", "--duration", "1") == (0, "")


@pytest.mark.parametrize(
    ("wrong", "options", "why"),
    [
        (("class Helix", "class Other"), "", "track helix (their_track:Helix) cannot be loaded: "),
        (("class Helix(TrackOptions)", "class Helix"), "", "track helix: <class 'their_track.Helix'> is not a subclass "
         "of colibri.TrackOptions"),
        (("angle.cos()", "np.cos(angle)"), "", "track helix: Helix: NameError: name 'np' is not defined"),
        (("return Track(position, duration_s=60.0)", "return 3"), "", "track helix: Helix: AttributeError: "),
        (("self.climb * t", "self.climb / 0.0 * t"), "", "track helix: Helix: ZeroDivisionError: "),
        (("", ""), ":width=3", 'track helix: unknown option "width" (choose radius, climb)'),
        (("", ""), ":radius=x", "track helix: radius=x: Expected `float`, got `str`"),
        (("", ""), ":climb=-1", "track helix:climb=-1 is at -58.99 m after 59.99 s, below the floor of 0 m"),
    ],
)  # fmt: skip
def test_a_foreign_track_that_cannot_be_flown_is_one_line(
    fly_theirs: FlyTheirs, wrong: tuple[str, str], options: str, why: str
) -> None:
    link = "udp" if "np.cos" in wrong[1] else "direct"  # over UDP, processes load it
    code, said = fly_theirs(EXAMPLE.replace(*wrong) if wrong[0] else EXAMPLE, f"helix{options}", "--link", link)
    assert (code, said.count("\n")) == (2, 1)
    assert said.startswith(f"colibri: error: {why}")
