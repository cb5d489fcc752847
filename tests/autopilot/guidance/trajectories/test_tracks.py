from contextlib import suppress
from math import inf, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.guidance.trajectories.registry import TrackError, track
from colibri.autopilot.guidance.trajectories.tracks import OPTIONS, THESIS_TRACKS, Track, position
from colibri.flights.spec import TRACK_HELP
from tests.support.refusals import refusal_of


def test_the_five_of_the_thesis() -> None:
    assert list(THESIS_TRACKS) == ["spiral", "expanding-spiral", "line", "wave", "crown"]
    assert all(one.yaw is None and one.duration_s == 100.0 for one in THESIS_TRACKS.values())


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("loop", f"unknown track \"loop\" (choose {', '.join([*THESIS_TRACKS, *OPTIONS])})"),
        ("spiral:radius=3", f"track spiral takes no options, but these do: {', '.join(OPTIONS)}"),
        ("circle:", "track circle: options are KEY=VALUE[,KEY=VALUE…], not '': choose radius, speed, height, yaw"),
        ("hover:2", "track hover: options are KEY=VALUE[,KEY=VALUE…], not '2': choose x, y, height, yaw"),
        ("hover:x=1,", "track hover: options are KEY=VALUE[,KEY=VALUE…], not 'x=1,': choose x, y, height, yaw"),
        ("hover:x=1,x=2", "track hover: x is given twice"),
        ("hover:z=1", 'track hover: unknown option "z" (choose x, y, height, yaw)'),
        ("circle:radius=0", "track circle: radius=0: Expected `float` >= 0.01"),
        ("ramped:speed=0.3", "track ramped: speed=0.3: must be at least 0.5, acceleration times 2 s"),
        ("ramped:turn=up", "track ramped: turn=up: choose left, right"),
        ("circle:speed=fast", "track circle: speed=fast: Expected `float`, got `str`"),
        ("hover:height=nan", "track hover: height=nan: Expected `float` >= -1000.0"),
        ("lemniscate:yaw=90", "track lemniscate: yaw=90: choose path, fixed"),
        ("waypoints", "track waypoints needs file: waypoints:file=FILE"),
        ("waypoints:a.csv,file=b.csv", "track waypoints: file is given twice"),
        ("waypoints:a.csv,b.csv", "track waypoints: options are KEY=VALUE[,KEY=VALUE…], not 'a.csv,b.csv': "
         "choose file, speed, margin, tolerance"),
        ("waypoints:a.csv,speed=fast", "track waypoints: speed=fast: choose max, or a number"),
        ("waypoints:a.csv,speed=0", "track waypoints: speed=0: Expected `float` >= 0.01"),
        ("waypoints:a.csv,speed=max,margin=0.5", "track waypoints: margin=0.5: Expected `float` <= 0.4"),
        ("waypoints:a.csv", "a.csv: No such file or directory"),
    ],
)  # fmt: skip
def test_what_is_no_track_is_one_line(name: str, line: str) -> None:
    assert refusal_of(track, name) == line


@given(st.sampled_from([*THESIS_TRACKS, *OPTIONS]), st.text(st.characters(exclude_categories=["Cs"]), max_size=30))
def test_any_text_is_a_track_or_a_line(name: str, text: str) -> None:
    if "waypoints" in name:
        text = "missing/" + text.replace("\0", "").replace("/", "").replace("..", "")
    with suppress(TrackError):
        assert isinstance(track(f"{name}:{text}"), Track)


@pytest.mark.parametrize(
    ("name", "t", "wanted"),
    [
        ("hover", 50.0, (0.0, 0.0, 2.0)),
        ("hover:x=1,y=-2,height=3", 0.0, (1.0, -2.0, 3.0)),
        ("lemniscate", 0.75, (4.0 * np.sqrt(0.5), 2.0, 3.0)),
        ("lemniscate:size=2,lap=5,height=1", 1.25, (2.0, 0.0, 1.0)),
        ("circle", 0.0, (2.0, 0.0, 2.0)),
        ("circle:radius=3,speed=4,height=5", 3.0 * pi / 8.0, (0.0, 3.0, 5.0)),
    ],
)
def test_where_they_are(name: str, t: float, wanted: tuple[float, float, float]) -> None:
    assert position(track(name), np.array([t]))[0] == pytest.approx(wanted, abs=1e-12)
    assert track(name).duration_s == inf


def test_after_the_end_nothing_moves() -> None:
    flown, t = track("wave"), np.array([100.0, 100.0001, 1e6])
    assert position(flown, t) == pytest.approx(np.tile([-2.0, 200.0, 5.0], (3, 1)))
    assert position(flown, t, 1)[:, 1] == pytest.approx([2.0, 0.0, 0.0])


def test_a_track_without_end_says_its_yaw() -> None:
    with pytest.raises(ValueError, match="needs a formula for its yaw"):
        Track(THESIS_TRACKS["spiral"].position, duration_s=inf)


def test_the_help_names_every_track_and_option() -> None:
    for name in THESIS_TRACKS:
        assert name in TRACK_HELP
    for name, kind in OPTIONS.items():
        (usage,) = [part for part in TRACK_HELP.replace("; ", " ").split(" ") if part.startswith(name)]
        assert all(option in usage.lower() for option in kind.__struct_fields__)


@pytest.mark.parametrize(
    ("options", "radius", "sign"), [("speed=5", 5.0, -1.0), ("radius=2,turn=right,acceleration=2", 2.0, 1.0)]
)
def test_ramped_follows_its_speed(options: str, radius: float, sign: float) -> None:
    flown, steps = track(f"ramped:{options}"), 20_000
    t = np.linspace(0.0, flown.duration_s, steps)
    acceleration = 0.25 if "acceleration" not in options else 2.0
    steady = 5.0 / acceleration - 2.0
    ends = np.cumsum([2.0, steady, 4.0, steady])
    edge = np.sin(0.25 * pi * np.where(t < 2.0, t, t - ends[3])) ** 2
    turn = np.cos(0.25 * pi * (t - ends[1]))
    shape = np.select([t < ends[0], t < ends[1], t < ends[2], t < ends[3]], [edge, 1.0, turn, -1.0], edge - 1.0)
    speed = np.concatenate([[0.0], np.cumsum(acceleration * 0.5 * (shape[1:] + shape[:-1]) * t[1])])
    angle = sign * np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * t[1])]) / radius
    wanted = np.stack([radius * np.sin(angle), radius * np.cos(angle), np.full(steps, 2.5)], axis=1)
    assert np.abs(position(flown, t) - wanted).max() < 1e-4
    assert np.abs(np.linalg.norm(position(flown, t, 1), axis=1) - speed).max() < 1e-4
