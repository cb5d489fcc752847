"""Wind files, gusts and their command line, and that the world feels them."""

from argparse import ArgumentTypeError
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.spec import from_values
from colibri.plant.environment.turbulence import CALM, Air
from colibri.plant.environment.weather import INTENSITIES, NO_WIND, Gust, Intensity, RecordedWind, Weather, Wind
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, World, starting_world
from colibri.plant.spec import WorldSpec
from colibri.plant.texts import gust
from colibri.plant.texts import wind as read_wind
from tests.support.plant_flights import FRAME_US, hover, hummingbird, rpm
from tests.support.refusals import refusal_of

VEHICLE = hummingbird("drag", "rotor-lag")
START = Start(z=9.0, rotors=rpm(VEHICLE, VEHICLE.hover_speed))
SPEEDS = st.floats(0.0, 150.0)
WINDS = st.builds(Wind, SPEEDS, st.floats(0.0, 360.0))
GUSTS = st.builds(Gust, WINDS, st.floats(0.0, 1e4), st.floats(1e-3, 1e4))


def flown(weather: Weather, frames: int = 100) -> list[World]:
    physics, worlds = Physics(VEHICLE, "rk4", weather), [starting_world(START, VEHICLE, weather)]
    for _ in range(frames):
        worlds.append(physics.step(worlds[-1], hover(VEHICLE), FRAME_US))
    return worlds


def written(folder: Path, text: str) -> Path:
    path = folder / "wind.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_gust_is_one_minus_cosine() -> None:
    blows = gust("6@270:start=10,duration=4")
    east = [blows.velocity_at(t)[0] for t in (0.0, 10.0, 11.0, 12.0, 13.0, 14.0, 99.0)]
    assert east == pytest.approx([0.0, 0.0, 3.0, 6.0, 3.0, 0.0, 0.0])
    times = np.linspace(10.0, 14.0, 4001)
    assert np.trapezoid([blows.velocity_at(t)[0] for t in times], times) == pytest.approx(6.0 * 4.0 / 2.0)


def test_gusts_add_to_the_wind() -> None:
    air = Air(Weather(read_wind("5@270"), (gust("4@0:start=1,duration=2"), gust("2@270:start=1,duration=2"))))
    assert air.go_on(None, 2_000_000, 9.0, CALM, 4000)[0] == pytest.approx((7.0, -4.0, 0.0), abs=1e-12)


def test_a_wind_from_a_file_is_linear_between_its_times(tmp_path: Path) -> None:
    path = written(tmp_path, "t, east, north, up\n1,0,0,0\n3,4,-2,1\n\n4,4,-2,3\n")
    wind = read_wind(str(path))
    assert [wind.velocity_at(t) for t in (0.0, 1.0, 2.0, 3.0, 3.5, 4.0, 9.0)] == [
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (2.0, -1.0, 0.5),
        (4.0, -2.0, 1.0),
        (4.0, -2.0, 2.0),
        (4.0, -2.0, 3.0),
        (4.0, -2.0, 3.0),
    ]
    assert str(wind) == str(path)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "line 1: must be t,east,north,up"),
        ("t,x,y,z\n0,1,2,3\n", "line 1: must be t,east,north,up"),
        ("t,east,north,up\n", "line 1: the file ends, and a wind needs a row"),
        ("t,east,north,up\n0,1,2\n", "line 2: must be four numbers, t,east,north,up"),
        ("t,east,north,up\n0,1,2,3\n1,strong,0,0\n", "line 3: must be four numbers"),
        ("t,east,north,up\n0,1,2,nan\n", "line 2: must be four numbers"),
        ("t,east,north,up\n0,0,0,0\n\n0,1,0,0\n", "line 4: t must rise, and 0 is not after 0"),
        ("t,east,north,up\n0,0,200,0\n", "line 2: no wind is faster than 150 m/s"),
    ],
)
def test_a_file_that_is_no_wind(tmp_path: Path, text: str, line: str) -> None:
    path = written(tmp_path, text)
    assert refusal_of(read_wind, str(path)).startswith(f"{path}: {line}")


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ArgumentTypeError, match=r"none\.csv: No such file"):
        read_wind(str(tmp_path / "none.csv"))
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ArgumentTypeError, match=r"bytes\.csv: 'utf-8' codec"):
        read_wind(str(tmp_path / "bytes.csv"))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("6@270", "must be SPEED@FROM:start=S,duration=S"),
        ("6:start=1,duration=2", "must be SPEED@FROM in m/s"),
        ("6@270:start=1", "must be SPEED@FROM:start=S,duration=S"),
        ("6@270:start=1,duration=2,up=3", "must be SPEED@FROM:start=S,duration=S only"),
        ("6@270:start=1,duration=2,", "must be SPEED@FROM:start=S,duration=S only"),
        ("6@270:start=-1,duration=2", "the start must not be negative"),
        ("6@270:start=1,duration=0", "the start must not be negative, the duration above zero"),
        ("6@270:start=x,duration=1", "must be SPEED@FROM:start=S,duration=S"),
        ("600@270:start=1,duration=1", "no wind is faster than 150 m/s"),
    ],
)
def test_what_is_no_gust(text: str, line: str) -> None:
    assert refusal_of(gust, text).startswith(line)


@given(WINDS, st.lists(GUSTS, max_size=3), st.sampled_from([None, *INTENSITIES]), st.integers(0, 2**32))
def test_weather_is_read_back_from_texts(
    wind: Wind, gusts: list[Gust], turbulence: Intensity | None, seed: int
) -> None:
    texts = {"wind": str(wind), "gusts": [str(each) for each in gusts], "turbulence": turbulence, "seed": str(seed)}
    assert from_values(WorldSpec, texts).weather == Weather(wind, tuple(gusts), turbulence, seed)


def test_air_that_may_change_but_does_not_is_a_constant_wind(tmp_path: Path) -> None:
    steady = RecordedWind(tmp_path, (0.0,), ((3.0, -2.0, 1.0),))
    changing = RecordedWind(tmp_path, (0.0, 1.0), ((3.0, -2.0, 1.0),) * 2)
    assert Air(Weather(steady)).steady == (3.0, -2.0, 1.0)
    assert Air(Weather(changing)).steady is None
    assert flown(Weather(steady)) == flown(Weather(changing))


def test_a_world_says_what_air_it_is_in() -> None:
    weather = Weather(NO_WIND, (gust("6@270:start=0.1,duration=0.2"),))
    worlds = flown(weather)
    assert [world.wind_enu_m_s for world in worlds] == [
        weather.gusts[0].velocity_at(world.time_us * 1e-6) for world in worlds
    ]
    assert worlds[-1].state[0] > 0.0


def test_a_world_has_one_future() -> None:
    weather = Weather(Wind(8.0, 270.0), turbulence="severe", seed=4)
    worlds = flown(weather, 300)
    physics = Physics(VEHICLE, "rk4", weather)
    for frame in (299, 0, 150):
        assert physics.step(worlds[frame], hover(VEHICLE), FRAME_US) == worlds[frame + 1]
    assert flown(weather._replace(seed=5), 300)[-1].state != worlds[-1].state
