"""Wind, parts left out and starts on the command line: what they do to a flight, over every link."""

from math import degrees
from pathlib import Path

import numpy as np
import pytest

from colibri.common.process.lifecycle import nudge_m
from colibri.plant.spec import PARTS
from colibri.plant.vehicle.description import load_vehicle
from tests.support.recorded import rows
from tools.harness.processes import fly, fly_thesis, states, topic_rows

REALISTIC = ("spiral", "--profile", "thesis", "--vehicle", "hummingbird", "--integrator", "rk4", "--duration")
TUMBLING = "x=1,y=2,z=20,phi=170,theta=-10,psi=123.4,vx=3,vy=-2,vz=1,p=10,q=-1,r=0.5,rotors=4000"


def test_a_flight_begins_as_it_is_told(tmp_path: Path) -> None:
    fly(tmp_path, *REALISTIC, "1", "--link", "direct", "--start", TUMBLING)
    flown = rows(tmp_path / "flight.csv")
    start = {name: column[0] for name, column in flown.items()}
    assert (start["x"], start["y"], start["z"]) == (1.0 + nudge_m(), 2.0 + nudge_m(), 20.0)
    assert degrees(start["phi"]) == pytest.approx(170.0)
    assert degrees(start["theta"]) == pytest.approx(-10.0)
    assert degrees(start["psi"]) == pytest.approx(123.4)
    assert (start["p"], start["q"], start["r"]) == (10.0, -1.0, 0.5)
    assert np.hypot(np.hypot(start["u"], start["v"]), start["w"]) == pytest.approx(14.0**0.5)
    assert start["omega1"] == pytest.approx(4000.0 * 2.0 * np.pi / 60.0)


def test_the_start_is_the_profiles_where_it_is_not_told(tmp_path: Path) -> None:
    fly_thesis(tmp_path, "line", "--link", "direct", "--duration", "1", "--start", "z=3")
    flown = rows(tmp_path / "flight.csv")
    assert (flown["x"][0], flown["y"][0], flown["z"][0]) == (nudge_m(), -1.0 + nudge_m(), 3.0)
    assert flown["omega4"][0] == 3000.0
    assert flown["psi"][0] == pytest.approx(np.arctan2(-2.0, 1.0) + np.pi / 2.0, abs=1e-12)


def test_a_velocity_is_in_the_earth_frame(tmp_path: Path) -> None:
    fly(tmp_path, *REALISTIC, "1", "--link", "direct", "--start", "z=9,psi=90,vx=2,rotors=4740", lost=True)
    flown = rows(tmp_path / "flight.csv")
    assert (flown["u"][0], flown["v"][0], flown["w"][0]) == pytest.approx((0.0, -2.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("part", PARTS)
def test_every_part_makes_a_difference(tmp_path: Path, part: str) -> None:
    for name, options in {"with": (), "without": ("--without", part)}.items():
        fly(tmp_path / name, *REALISTIC, "3", "--link", "direct", *options)
    flown, ideal = (np.stack(list(topic_rows(tmp_path / name).values())) for name in ("with", "without"))
    assert not np.array_equal(flown, ideal, equal_nan=True)


@pytest.mark.parametrize("part", PARTS)
def test_a_part_left_out_is_that_table_alone(part: str) -> None:
    vehicle = load_vehicle("hummingbird")
    left = vehicle.without({part})
    present = {"rotor-lag": left.rotors.lag, "drag": left.drag, "ground": left.ground, "battery": left.battery}
    assert [name for name, table in present.items() if table is None] == [part]
    assert left.without(PARTS) == vehicle.without(PARTS)
    assert vehicle.without(()) == vehicle


def test_wind_blows_from_where_it_is_set(tmp_path: Path) -> None:
    for name, wind in {"calm": "0@0", "west": "4@270"}.items():
        fly(tmp_path / name, *REALISTIC, "4", "--link", "memory", "--wind", wind, "--start", "z=2")
    calm, west = (rows(tmp_path / name / "flight.csv") for name in ("calm", "west"))
    assert west["x"][-1] - calm["x"][-1] > 0.1


@pytest.mark.long
def test_the_same_seed_is_the_same_world_over_every_link(tmp_path: Path) -> None:
    weather = ("--wind", "8@270", "--turbulence", "moderate", "--gust=6@0:start=1,duration=1")
    options = ("hover", "--duration", "3", "--start", TUMBLING, "--without", "battery", *weather)
    flights = {"udp": ("udp", "3"), "memory": ("memory", "3"), "other": ("memory", "4")}
    reports = {
        name: fly(tmp_path / name, *options, "--link", link, "--seed", seed) for name, (link, seed) in flights.items()
    }
    assert reports["udp"]["trajectory_sha256"] == reports["memory"]["trajectory_sha256"]
    assert reports["other"]["trajectory_sha256"] != reports["memory"]["trajectory_sha256"]
    assert (states(tmp_path / "udp") == states(tmp_path / "memory")).all()
    reported = [reports["udp"][key] for key in ("wind", "gusts", "turbulence")]
    assert reported == ["8.0@270.0", ["6.0@0.0:start=1.0,duration=1.0"], "moderate"]


def test_the_log_of_the_plant_ends_with_battery_and_wind(tmp_path: Path) -> None:
    fly(tmp_path, *REALISTIC, "3", "--link", "memory", "--wind", "4@270")
    flown = topic_rows(tmp_path)
    assert tuple(flown)[-5:] == ("voltage_v", "charge_ah", "wind_east", "wind_north", "wind_up")
    assert np.isnan(flown["voltage_v"][0])
    assert (flown["voltage_v"][1:] < 12.6).all()
    assert (np.diff(flown["charge_ah"]) > 0.0).all()
    assert flown["wind_east"] == pytest.approx(4.0)
    assert flown["wind_north"] == pytest.approx(0.0)
