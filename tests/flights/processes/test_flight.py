"""Profile `flight` on the vehicle with rotor lag, limits, drag and battery: how well it tracks, whatever is wrong."""

import re
from pathlib import Path

import numpy as np
import pytest

from colibri import plant
from colibri.autopilot.control.interface import FALLBACK_CODES, Fallback
from colibri.mavlink.ulog.flight_topics import DECISION
from tests.support.family import CAUGHT_UP_S, DURATION_S, LAPS_S, STARTS, Flown, fly_family
from tools.harness.processes import fly, rows, topic_rows

HUMMINGBIRD = Path(plant.__file__).parent / "vehicle" / "models" / "hummingbird.toml"
IDLE, MAX_SPEED = 83.8, 838.0
FEW_STARTS = 8
"""Of the 50 that `make test-long` flies, for longer."""


def vehicle_file(folder: Path, **changes: str) -> str:
    """Write the Hummingbird's file with other values, keys as TABLE__KEY; return its path."""
    text = HUMMINGBIRD.read_text(encoding="utf-8")
    for name, value in changes.items():
        table, key = name.split("__")
        head, body = text.split(f"[{table}]\n")
        this, *others = re.split(r"(?=^\[)", body, flags=re.MULTILINE)
        this = f"{key} = {value}\n" + re.sub(rf"^{key} = .*\n", "", this, flags=re.MULTILINE)
        text = f"{head}[{table}]\n{this}{''.join(others)}"
    path = folder / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("track", "duration_s", "reach_m"),
    [
        ("spiral", 25, 0.001),
        ("lemniscate", 32, 0.005),
        pytest.param("crown", 25, 0.003, marks=pytest.mark.long),
        pytest.param("expanding-spiral", 40, 0.005, marks=pytest.mark.long),
        pytest.param("line", 25, 0.001, marks=pytest.mark.long),
        pytest.param("wave", 25, 0.002, marks=pytest.mark.long),
        pytest.param("lemniscate:yaw=fixed", 26, 0.002, marks=pytest.mark.long),
    ],
)
def test_every_track_is_tracked(tmp_path: Path, track: str, duration_s: int, reach_m: float) -> None:
    figures = fly(tmp_path, track, "--link", "memory", "--duration", str(duration_s))
    assert figures["profile"] == "flight"
    assert figures["rmse_after_20s_m"] < reach_m
    assert figures["qp_failures"] == 0
    assert not any(figures["fallbacks"].values())
    truth = topic_rows(tmp_path)
    speeds = np.array([truth[f"omega{number}"] for number in range(1, 5)])
    assert speeds.min() >= IDLE
    assert speeds.max() <= MAX_SPEED


def test_two_processes_fly_the_same_flight(tmp_path: Path) -> None:
    """Frames at 250 Hz, control at 125 Hz: over UDP and in memory the same, bit for bit."""
    flights = [fly(tmp_path / link, "lemniscate", "--link", link, "--duration", "4") for link in ("udp", "memory")]
    assert flights[0]["frames"] == flights[1]["frames"] == 1000
    assert flights[0]["trajectory_sha256"] == flights[1]["trajectory_sha256"]
    flown = [(tmp_path / link / "flight.csv").read_bytes() for link in ("udp", "memory")]
    assert flown[0] == flown[1]
    assert len(flown[0].splitlines()) == 1 + 501


@pytest.mark.long
def test_daqp_and_clarabel_give_the_same_inputs(tmp_path: Path) -> None:
    """Catching the lemniscate up, where limits bind, and along it: every input to 1e-4 N and N m."""
    flown = []
    for solver in ("daqp", "clarabel"):
        fly(tmp_path / solver, "lemniscate", "--link", "direct", "--duration", "8", "--solver", solver)
        flown.append(rows(tmp_path / solver / "flight.csv"))
    for number in range(1, 5):
        assert flown[1][f"U{number}"] == pytest.approx(flown[0][f"U{number}"], abs=1e-4)


WRONG = {
    "20 % heavier": {"body__mass_kg": "0.8376"},
    "20 % lighter": {"body__mass_kg": "0.5584"},
    "30 % more inertia": {"body__inertia_kg_m2": "[0.00442, 0.00442, 0.0078]"},
    "30 % less inertia": {"body__inertia_kg_m2": "[0.00238, 0.00238, 0.0042]"},
    "one rotor 15 % weak": {"rotors__strength": "[1.0, 0.85, 1.0, 1.0]"},
}


@pytest.mark.parametrize(
    "what",
    [
        "20 % heavier",
        *(
            pytest.param(what, marks=pytest.mark.long)
            for what in ("one rotor 15 % weak", "20 % lighter", *(it for it in WRONG if "inertia" in it))
        ),
    ],
)
def test_a_wrong_model_costs_little(tmp_path: Path, what: str) -> None:
    other = ("--plant-vehicle", vehicle_file(tmp_path, **WRONG[what]))
    figures = fly(tmp_path / "out", "spiral", "--link", "memory", "--duration", "25", *other)
    error = rows(tmp_path / "out" / "flight.csv")
    assert figures["plant_vehicle"] == other[1]
    assert max_error_m(error, 20.0) < 0.001
    assert figures["qp_failures"] == 0


def test_constant_wind_leaves_no_offset(tmp_path: Path) -> None:
    fly(tmp_path, "hover:height=3", "--link", "memory", "--duration", "15", "--wind", "5@270")
    flown = rows(tmp_path / "flight.csv")
    assert max_error_m(flown, 10.0) < 0.001
    assert abs(flown["theta"][-1]) > 0.05  # it leans into the wind


def max_error_m(flown: dict[str, np.ndarray], after_s: float) -> float:
    settled = flown["t"] >= after_s
    axes = [flown[axis][settled] - flown[f"{axis}_ref"][settled] for axis in "xyz"]
    return float(np.linalg.norm(axes, axis=0).max())


def test_with_tight_limits_constraints_bind_and_it_still_flies(tmp_path: Path) -> None:
    """600 rad/s at most, hover at 497: take the spiral up from 2 m away, never ask for more."""
    vehicle = ("--vehicle", vehicle_file(tmp_path, rotors__max_speed="600.0", rotors__idle_speed="60.0"))
    figures = fly(tmp_path / "out", "spiral", "--link", "memory", "--duration", "25", *vehicle)
    truth = topic_rows(tmp_path / "out")
    assert max(truth[f"omega{number}"].max() for number in range(1, 5)) <= 600.0
    assert figures["constrained_samples"]["rotors"] > 10
    assert figures["qp_failures"] == 0
    assert figures["rmse_after_20s_m"] < 0.001


@pytest.mark.parametrize(
    "start",
    [
        *("phi=170", "theta=89", "phi=170,p=6,q=-6,r=5"),
        *(
            pytest.param(it, marks=pytest.mark.long)
            for it in ("phi=180", "p=10", "q=10", "r=10", "phi=120,theta=40,q=10")
        ),
    ],
)
def test_any_start_is_recovered_from(tmp_path: Path, start: str) -> None:
    """20 m up: upright within a second, no lower than 3 m below, and back at its place."""
    fly(tmp_path, "hover:height=20", "--link", "memory", "--duration", "10", "--start", f"x=0,y=0,z=20,{start}")
    flown = rows(tmp_path / "flight.csv")
    tilt_cosine = np.cos(flown["phi"]) * np.cos(flown["theta"])
    assert tilt_cosine[flown["t"] > 1.0].min() > np.cos(np.radians(65.0))
    assert flown["z"].min() > 17.0
    assert max_error_m(flown, 8.0) < 0.01
    if "170" in start:
        fallback = topic_rows(tmp_path, DECISION)["fallback"]
        recovering = fallback == FALLBACK_CODES[Fallback.RECOVERY]
        assert recovering[0]
        assert not recovering[flown["t"][1:] > 1.0].any()


RECOVERED: dict[str, dict[str, float]] = {
    "upside down": {"phi": 180.0},
    "nose down": {"theta": 89.0},
    "tumbling upside down": {"phi": 170.0, "p": 6.0, "q": -6.0, "r": 5.0},
}


def test_whichever_way_it_turns_it_recovers() -> None:
    """Some starts a millimetre apart: which way is the shortest is decided by nothing when it is upside down."""
    check_recovered(fly_family("hover:height=20", FEW_STARTS, 2.5, x=0.0, y=0.0, z=20.0, **RECOVERED["upside down"]))


@pytest.mark.long
@pytest.mark.parametrize("start", RECOVERED)
def test_whichever_way_it_turns_it_comes_back(start: str) -> None:
    flown = fly_family("hover:height=20", STARTS, 10.0, x=0.0, y=0.0, z=20.0, **RECOVERED[start])
    check_recovered(flown)
    assert max(it.error_m[it.t > 8.0].max() for it in flown) < 0.01


def check_recovered(flown: list[Flown]) -> None:
    assert max(it.tilt_deg[it.t > 1.0].max() for it in flown) < 65.0
    assert min(it.z_m.min() for it in flown) > 17.0


def test_an_impossible_track_is_followed_upright() -> None:
    """36 m/s and 400 m/s²: from some starts a millimetre apart, for these are chaotic flights."""
    check_upright_and_near(fly_family("lemniscate:lap=1.0", FEW_STARTS, 6.0))


@pytest.mark.long
@pytest.mark.parametrize("lap_s", LAPS_S)
def test_an_impossible_track_is_followed_from_any_start(lap_s: float) -> None:
    """The bounds of docs/flight.md over 50 starts of 40 s each."""
    check_upright_and_near(fly_family(f"lemniscate:lap={lap_s}", STARTS, DURATION_S))


def check_upright_and_near(flown: list[Flown]) -> None:
    """Check the bounds that docs/flight.md states: the tilt's limit is 70°, the figure's size 4 m to either side."""
    assert max(it.tilt_deg.max() for it in flown) < 75.0
    assert max(it.error_m[it.t > CAUGHT_UP_S].max() for it in flown) < 12.0
    assert min(it.z_m.min() for it in flown) > 1.5  # it begins at 2 m
    assert max(it.z_m.max() for it in flown) < 4.5


@pytest.mark.parametrize("lap_s", [pytest.param(4.0, marks=pytest.mark.long), 1.0])
def test_what_no_vehicle_can_follow_takes_it_to_its_limits(tmp_path: Path, lap_s: float) -> None:
    figures = fly(tmp_path, f"lemniscate:lap={lap_s}", "--link", "memory", "--duration", "10")
    assert figures["constrained_samples"]["rotors"] + figures["constrained_samples"]["rates"] > 0


def test_it_stands_on_the_ground_until_it_is_time(tmp_path: Path) -> None:
    """From rest on the ground straight up, and no sinking before."""
    fly(tmp_path, "hover:height=1.5", "--link", "memory", "--duration", "8", "--start", "x=0,y=0,z=0,rotors=0")
    flown = rows(tmp_path / "flight.csv")
    assert flown["z"].min() > -0.003
    assert max_error_m(flown, 6.0) < 0.005
