"""Profile `flight` on the vehicle with rotor lag, limits, drag and battery: how well it tracks, whatever is wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.autopilot.control.interface import FALLBACK_CODES, Fallback
from colibri.mavlink.ulog.flight_topics import DECISION
from tests.support.family import CAUGHT_UP_S, DURATION_S, LAPS_S, STARTS, fly_family
from tests.support.recorded import rows
from tools.harness.processes import fly, topic_rows

HUMMINGBIRD = colibri.load_vehicle("hummingbird")
IDLE, MAX_SPEED = 83.8, 838.0
FEW_STARTS = 6  # of the 50 that `make test-long` flies, for longer


@pytest.mark.parametrize(
    ("track", "duration_s", "reach_m"),
    [
        pytest.param("spiral", 22, 0.001, marks=pytest.mark.long),
        ("lemniscate", 26, 0.005),
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


@pytest.mark.long
def test_daqp_and_clarabel_give_the_same_inputs() -> None:
    """Every input to 1e-5 N and N m, at the start, where limits bind, and along the track.

    At a tolerance of 1e-10: at the profile's 1e-8, the gap of an interior point alone moves an input by 3e-4.
    """
    profile = colibri.load_profile("flight").replace("controllers.lpv-mpc.qp.tolerance", 1e-10)
    daqp, clarabel = (
        colibri.fly("lemniscate", profile=profile, solver=solver, link="direct", duration=8).samples
        for solver in ("daqp", "clarabel")
    )
    for number in range(1, 5):
        assert clarabel[f"U{number}"] == pytest.approx(daqp[f"U{number}"], abs=1e-5)


WRONG: dict[str, tuple[str, Any]] = {
    "20 % heavier": ("body.mass_kg", 0.8376),
    "20 % lighter": ("body.mass_kg", 0.5584),
    "30 % more inertia": ("body.inertia_kg_m2", [0.00442, 0.00442, 0.0078]),
    "30 % less inertia": ("body.inertia_kg_m2", [0.00238, 0.00238, 0.0042]),
    "one rotor 15 % weak": ("rotors.strength", [1.0, 0.85, 1.0, 1.0]),
}


@pytest.mark.parametrize("what", [pytest.param(it, marks=() if "heavier" in it else pytest.mark.long) for it in WRONG])
def test_a_wrong_model_costs_little(what: str) -> None:
    flight = colibri.fly("spiral", duration=22.0, plant_vehicle=HUMMINGBIRD.replace(*WRONG[what]))
    assert max_error_m(flight.samples, 20.0) < 0.001
    assert flight.report["qp_failures"] == 0


def test_constant_wind_leaves_no_offset(tmp_path: Path) -> None:
    fly(tmp_path, "hover:height=3", "--link", "memory", "--duration", "15", "--wind", "5@270")
    flown = rows(tmp_path / "flight.csv")
    assert max_error_m(flown, 10.0) < 0.001
    assert abs(flown["theta"][-1]) > 0.05  # it leans into the wind


def max_error_m(flown: Any, after_s: float) -> float:
    settled = flown["t"] >= after_s
    axes = [flown[axis][settled] - flown[f"{axis}_ref"][settled] for axis in "xyz"]
    return float(np.linalg.norm(axes, axis=0).max())


def test_with_tight_limits_constraints_bind_and_it_still_flies() -> None:
    """600 rad/s at most, hover at 497: take the spiral up from 2 m away, never ask for more."""
    vehicle = HUMMINGBIRD.replace("rotors.max_speed", 600.0).replace("rotors.idle_speed", 60.0)
    flight = colibri.fly("spiral", duration=22.0, vehicle=vehicle)
    assert max(flight.frames[f"omega{number}"].max() for number in range(1, 5)) <= 600.0
    assert flight.report["constrained_samples"]["rotors"] > 10
    assert flight.report["qp_failures"] == 0
    assert flight.report["rmse_after_20s_m"] < 0.001


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


@pytest.mark.parametrize(
    ("start", "count", "lasts_s"),
    [
        ("upside down", FEW_STARTS, 2.5),
        *(pytest.param(start, STARTS, 10.0, marks=pytest.mark.long) for start in RECOVERED),
    ],
)
def test_whichever_way_it_turns_it_recovers(start: str, count: int, lasts_s: float) -> None:
    """Some starts a millimetre apart: which way is the shortest is decided by nothing when it is upside down."""
    flown = fly_family("hover:height=20", count, lasts_s, x=0.0, y=0.0, z=20.0, **RECOVERED[start])
    assert max(it.tilt_deg[it.t > 1.0].max() for it in flown) < 65.0
    assert min(it.z_m.min() for it in flown) > 17.0
    assert lasts_s < 8.0 or max(it.error_m[it.t > 8.0].max() for it in flown) < 0.01


@pytest.mark.long
@pytest.mark.parametrize("lap_s", LAPS_S)
def test_an_impossible_track_is_followed_upright(lap_s: float) -> None:
    """Within the bounds of docs/flight.md: the tilt's limit is 70°, the figure's size 4 m to either side.

    At a lap of 1 s 36 m/s and 400 m/s²: from starts a millimetre apart, for these are chaotic flights.
    """
    flown = fly_family(f"lemniscate:lap={lap_s}", STARTS, DURATION_S)
    assert max(it.tilt_deg.max() for it in flown) < 75.0
    assert max(it.error_m[it.t > CAUGHT_UP_S].max() for it in flown) < 12.0
    assert min(it.z_m.min() for it in flown) > 1.0  # the track is at 3 m
    assert max(it.z_m.max() for it in flown) < 4.5


@pytest.mark.parametrize(
    ("radius_m", "rate_rad_s", "off_m"),
    [(1.0, 4.0, 0.5), (3.0, -2.6, 1.5)],  # the thrust of the second is 3.1 g at the bottom, of 2.2 g
)
def test_agile_flies_vertical_loops(radius_m: float, rate_rad_s: float, off_m: float) -> None:
    """Thrust points down at the top; beyond the largest thrust the loop is cut, and found again."""
    turns_s = 12.0 * np.pi / abs(rate_rad_s)

    def loop(t: float) -> tuple[float, float, float]:
        t = min(t, turns_s + 4.0)
        angle = rate_rad_s * (t * t / 8.0 if t < 4.0 else t - 2.0 - max(t - turns_s, 0.0) ** 2 / 8.0)
        return radius_m * float(np.sin(angle)), 0.0, 20.0 - radius_m * float(np.cos(angle))

    flown = colibri.fly(loop, profile="agile", link="direct", duration=turns_s + 7.0)
    upright = np.cos(flown.samples["phi"]) * np.cos(flown.samples["theta"])
    assert upright.min() < np.cos(np.radians(150.0))
    assert flown.lost is None
    assert flown.report["max_error_m"] < off_m
    assert flown.samples["z"][-1] == pytest.approx(20.0 - radius_m, abs=0.01)


def test_it_stands_on_the_ground_until_it_is_time(tmp_path: Path) -> None:
    fly(tmp_path, "hover:height=1.5", "--link", "memory", "--duration", "8", "--start", "x=0,y=0,z=0,rotors=0")
    flown = rows(tmp_path / "flight.csv")
    assert flown["z"].min() > -0.003
    assert max_error_m(flown, 6.0) < 0.005
