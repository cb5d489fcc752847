from typing import Any

import numpy as np
import pytest

import colibri
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.tuning.results import Compared, better, check_campaign, compare
from tests.support.tuning import WEIGHTS, planned

SEEDS = 40
TRACKS = {"grid": {"track": ["hover", "spiral"]}}
BESIDE: dict[str, Any] = {"objectives": {"share_lost": "mean"}}


def compared(after: Any, lost_after: int = 0, before: Any = 1.0, **tables: Any) -> list[Compared]:
    """Compare flights whose error differs from seed to seed and track to track, times `before`, and times `after`."""
    tuning = planned(**({"check_seeds": f"101-{100 + SEEDS}"} | TRACKS | tables))
    profile = colibri.load_profile("flight")
    campaign = check_campaign(tuning, profile, profile.replace(f"{WEIGHTS}.position", 200.0))
    chance = np.random.default_rng(1)
    errors = chance.uniform(0.1, 1.0, (2, SEEDS)) * np.array([[1.0], [5.0]]) * before
    values = np.concatenate([errors.ravel(), (errors * after).ravel()])
    lost = range(2 * SEEDS, 2 * SEEDS + lost_after)
    flown = {
        flight: FlightResult(flight, Verdict.LOST if flight in lost else Verdict.FLOWN, "", (float(value),), "")
        for flight, value in enumerate(values)
    }
    return compare(tuning, FlightTable(campaign, flown))


def test_pairs_show_what_the_spread_of_seeds_would_hide() -> None:
    noise = np.random.default_rng(2).normal(0.9, 0.02, (2, SEEDS))
    overall, hover, spiral = compared(noise)[:3]
    assert [overall.where, hover.where, spiral.where] == ["all", "hover", "spiral"]
    for each in (overall, hover, spiral):
        assert each.after / each.before - 1.0 == pytest.approx(each.change)
        assert each.low < each.change < each.high
        assert each.change == pytest.approx(-0.1, abs=0.01)
        assert each.high - each.low < 0.03
    assert better([overall])


def test_what_is_noise_is_no_better() -> None:
    noise = np.random.default_rng(3).normal(1.0, 0.3, (2, SEEDS))
    (overall, *_) = compared(noise)
    assert overall.low < 0.0 < overall.high
    assert not better([overall])
    assert not better(compared(1.1))


def test_worse_in_one_objective_is_not_better() -> None:
    both: dict[str, Any] = {"objectives": {"rmse_m": "mean", "share_lost": "mean"}}
    found = compared(0.5, lost_after=20, **both)
    lost = next(each for each in found if each.what == "share_lost")
    assert (lost.before, lost.after, lost.change) == (0.0, 0.25, 0.25)
    assert lost.low > 0.0
    assert not better(found)
    assert better(compared(0.5, **both))


def test_lost_flights_count_only_in_the_tuned_metric() -> None:
    tuned_for = compared(0.5, lost_after=2)[0]
    beside = next(each for each in compared(0.5, 2, **BESIDE) if each.what == "rmse_m, mean")
    assert tuned_for.after > 0.5 * tuned_for.before
    assert beside.change == pytest.approx(-0.5)


def test_what_is_rare_and_its_interval_are_in_the_same_unit() -> None:
    """Most of the resampled seeds have some, a few have none."""
    rare = np.zeros((2, SEEDS))
    rare[:, 0] = 50.0
    (overall, *_) = compared(0.5, before=rare)
    assert overall.change == pytest.approx(overall.after - overall.before)
    assert overall.low < overall.change < overall.high == 0.0
    assert overall.changes == ("-1.233", "-3.7 to +0")


def test_a_negative_metric_rises_by_a_positive_change() -> None:
    beside = next(each for each in compared(0.5, before=-1.0, **BESIDE) if each.what == "rmse_m, mean")
    assert beside.after > beside.before
    assert beside.change == pytest.approx(0.5)


def test_a_combination_of_which_nothing_is_known_has_no_row() -> None:
    found = compared(0.5, lost_after=SEEDS, **BESIDE)
    assert [each.where for each in found if each.what == "rmse_m, mean"] == ["all", "spiral"]
    assert [each.where for each in found if each.what == "share_lost"] == ["all", "hover", "spiral"]


def test_the_check_uses_other_seeds_the_same_for_both() -> None:
    mass = "plant-vehicle.body.mass_kg"
    tuning = planned(check_seeds="11-14", draw={mass: {"uniform": [0.68, 0.74]}}, **TRACKS)
    profile = colibri.load_profile("flight")
    points = list(check_campaign(tuning, profile, profile).points())
    assert len(points) == 2 * 2 * 4
    before, after = points[:8], points[8:]
    assert [(each.seed, each.factors[mass]) for each in before] == [(each.seed, each.factors[mass]) for each in after]
    assert not {each.factors[mass] for each in before} & {each.factors[mass] for each in tuning.campaign.points()}
    assert not {each.seed for each in before} & {each.seed for each in tuning.campaign.points()}
