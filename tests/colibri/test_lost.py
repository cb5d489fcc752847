import json
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colibri.analysis.limits import KEYS, ReportLimit, exceeded
from colibri.analysis.lost import (
    LIMIT_CYCLE_RAD_S,
    FlightSeries,
    Lost,
    ground_contact_s,
    ground_hits,
    impact,
    limit_cycle_rad_s,
    lost,
)
from colibri.analysis.recording import COLUMNS, Samples
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import load_vehicle
from tests.support.commands import VEHICLE, Refused, edited
from tools.harness.processes import fly

T = np.arange(0.0, 30.0, 0.01)


@pytest.fixture
def plan(tmp_path: Path) -> FlightPlan:
    return FlightPlan.of(FlightSpec.of("hover", out=tmp_path))


def flown(until_s: float = 30.0, **columns: Any) -> FlightSeries:
    """Return a hover at 2 m in which some columns are others."""
    t = T[until_s > T]
    table = np.zeros((len(t), len(COLUMNS)))
    for name, values in {"t": t, "z": 2.0, "z_ref": 2.0, **columns}.items():
        table[:, COLUMNS.index(name)] = values(t) if callable(values) else values
    nothing = np.zeros(len(t) - 1)
    codes = nothing.astype(np.int64)
    series = FlightSeries(len(t), load_vehicle("hummingbird"))
    series.add(Samples(table, codes, codes, nothing, nothing, nothing, np.zeros((len(t) - 1, 4), np.int64), nothing))
    return series


def loss(plan: FlightPlan, flight: FlightSeries) -> Lost:
    found = lost(plan, flight)
    assert found is not None
    return found


def test_one_that_stays_at_its_reference_is_not_lost(plan: FlightPlan) -> None:
    assert lost(plan, flown()) is None
    assert ground_contact_s(plan.plant_vehicle, flown()) == 0.0


def test_one_that_comes_down_is_lost_when_it_does(plan: FlightPlan) -> None:
    flight = flown(z=lambda t: np.maximum(0.0, 2.0 - 0.2 * np.maximum(0.0, t - 5.0)))
    found = loss(plan, flight)
    assert found.at_s == pytest.approx(15.0, abs=0.02)
    assert found.why == "on the ground, 2.0 m off its track, tilted 0°; later up to 2.0 m off"
    assert ground_contact_s(plan.plant_vehicle, flight) == pytest.approx(15.0, abs=0.02)


@pytest.mark.parametrize(
    ("columns", "found"),
    [
        ({"w": -2.9}, None),
        ({"w": -12.5}, "at 12.5 m/s, tilted 0°, at t = 5.00 s"),
        ({"phi": 2.0}, "at 0.0 m/s, tilted 115°, at t = 5.00 s"),
    ],
)
def test_a_hard_contact_is_an_impact(columns: dict[str, float], found: str | None) -> None:
    assert impact(flown(z=lambda t: np.where(t > 5.0, -0.5, 2.0), **columns)) == found


@pytest.mark.parametrize(("rate_rad_s", "swings"), [(0.5, False), (5.0, True)])
def test_a_swing_beside_the_track_is_a_limit_cycle(rate_rad_s: float, swings: bool) -> None:
    found = limit_cycle_rad_s(flown(phi=lambda t: rate_rad_s / 20.0 * np.sin(20.0 * t)))
    assert found is not None
    assert found == pytest.approx(rate_rad_s / 2.0**0.5, rel=0.05)
    assert (found > LIMIT_CYCLE_RAD_S) is swings
    assert limit_cycle_rad_s(flown(until_s=0.5)) is None


def test_a_short_touch_of_the_ground_is_no_loss(plan: FlightPlan) -> None:
    flight = flown(z=lambda t: np.where(abs(t - 5.0) < 0.3, 0.0, 2.0))
    assert ground_hits(plan.plant_vehicle, flight) == 1
    assert lost(plan, flight) is None
    assert ground_contact_s(plan.plant_vehicle, flight) == pytest.approx(0.59, abs=0.02)


def test_one_that_shall_land_may_touch_the_ground(plan: FlightPlan) -> None:
    assert lost(plan, flown(z=lambda t: np.maximum(0.0, 2.0 - t), z_ref=lambda t: np.maximum(0.0, 2.0 - t))) is None


def test_one_that_never_takes_off_is_lost_from_the_start(plan: FlightPlan) -> None:
    assert loss(plan, flown(z=0.0)).at_s == 0.0
    assert ground_contact_s(plan.plant_vehicle, flown(z=0.0)) == 0.0


def test_ending_upside_down_is_a_loss_if_ever_upright(plan: FlightPlan) -> None:
    found = loss(plan, flown(phi=lambda t: np.where(t < 7.0, 0.0, pi)))
    assert found.at_s == pytest.approx(7.0)
    assert "in the air, 0.0 m off its track, tilted 180°" in found.why
    assert lost(plan, flown(0.3, phi=pi)) is None


def test_one_that_drifts_away_is_lost_since_it_is_too_far(plan: FlightPlan) -> None:
    found = loss(plan, flown(x=lambda t: 0.4 * t))
    assert found.at_s == pytest.approx(12.5, abs=0.02)
    assert "later up to 12.0 m off" in found.why


@pytest.mark.parametrize(("speed_m_s", "is_lost"), [(-1.0, False), (0.2, False), (1.0, True)])
def test_a_short_flight_is_lost_if_its_error_grows(plan: FlightPlan, speed_m_s: float, is_lost: bool) -> None:
    flight = flown(10.0, x=lambda t: 30.0 + speed_m_s * t)
    assert (lost(plan, flight) is not None) is is_lost


def test_a_station_vehicle_is_not_judged_by_its_track(plan: FlightPlan) -> None:
    served = replace(plan, spec=replace(plan.spec, gcs=("udpout:127.0.0.1:1",)))
    assert lost(served, flown(z=0.0)) is None


def test_a_vehicle_that_cannot_be_flown_is_no_success(tmp_path: Path, refused: Refused) -> None:
    """A thousand times the moment of inertia that the autopilot knows."""
    heavy = edited(tmp_path, VEHICLE, "[0.0034, 0.0034, 0.006]", "[3.4, 3.4, 0.006]")
    options = ("--plant-vehicle", heavy, "--link", "memory", "--duration", "10", "--no-figures", "--quiet")
    said = refused("fly", "spiral", *options, "--out", tmp_path, code=1)
    assert said.startswith("lost at t = ")
    assert "on the ground" in said
    assert said.endswith(f"; the logs are in {tmp_path}")
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["lost"] in said
    assert 1.0 < report["lost_at_s"] < 6.0
    assert report["ground_contact_s"] > 0.1


def test_numbers_of_the_report_have_limits(tmp_path: Path, refused: Refused) -> None:
    report = fly(tmp_path, "hover", "--link", "memory", "--duration", "1", "--fail-above", "qp_failures=0")
    assert report["lost"] is None
    assert report["ground_contact_s"] == 0.0
    limits = ("--no-figures", "--fail-above", "0.1", "--fail-above", "max_error_m=0.5", "--fail-above", "fallbacks=0")
    flight = ("fly", "hover", "--start", "x=1", "--link", "memory", "--duration", "1", "--quiet", *limits)
    assert refused(*flight, "--out", tmp_path, code=1) == (
        "--fail-above: rmse_after_20s_m is missing in this flight; its limit is 0.1; "
        f"max_error_m is 1, above 0.5; the logs are in {tmp_path}"
    )


def test_every_number_that_may_have_a_limit_is_in_the_report(tmp_path: Path) -> None:
    options = ("--link", "memory", "--duration", "21", "--feedback", "sensors", "--window", "5:20")
    report = fly(tmp_path, "hover", *options)
    assert exceeded([ReportLimit(key, 1e9) for key in KEYS], report) == []
    assert len(exceeded([ReportLimit(key, -1.0) for key in KEYS], report)) == len(KEYS)
