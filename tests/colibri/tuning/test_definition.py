from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.campaigns.definition import tables_of
from colibri.tuning.definition import TuningTables
from tests.support.tuning import POSITION, RATE, TABLES, WEIGHTS, planned

TRACKS = {"grid": {"track": ["hover", "spiral"]}}


def range_of(**given: Any) -> dict[str, Any]:
    return {"tune": {f"{WEIGHTS}.position": given}}


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"tune": {}}, "tune: at least one number is required"),
        ({"tune": {"controllers.lpv-mpc.weights.positon": {"uniform": [1, 200]}}}, 'did you mean "position"'),
        ({"tune": {"track": {"choice": ["hover", "spiral"]}}}, "tune: track is not a number of a profile"),
        (
            {"tune": {"vehicle.body.mass_kg": {"uniform": [0.6, 0.8]}}},
            "vehicle.body.mass_kg is not a number of a profile",
        ),
        ({"tune": {f"{WEIGHTS}": {"uniform": [1, 2]}}}, f"{WEIGHTS}: the profile has "),
        (
            {"tune": {f"{WEIGHTS}.rate": {"uniform": [0, 1]}, f"{RATE}*": {"uniform": [0, 2]}}},
            f"tune: {RATE} is given twice",
        ),
        (range_of(uniform=[200, 1]), "position: uniform: 200 to 1 is an empty range"),
        (range_of(uniform=[200, 300]), "position: the profile has 100, not within 200 to 300: widen that"),
        (range_of(normal=[100, 3]), "position: expected one of uniform, log-uniform, integers, choice, as in"),
        (range_of(integers=[1, 200.0]), r"position: integers: expected \[lowest, highest\], not \[1, 200.0\]"),
        (range_of(integers=[200, 200]), "position: integers: 200 to 200 is an empty range"),
        (range_of(choice=[100.0]), "position: choice: needs two values or more"),
        (range_of(choice=[10.0, 20.0]), "position: the profile has 100.0: put it among 10.0, 20.0"),
        (range_of(uniform=[-5, 200]), rf"{POSITION} = -5.0: .*position: Expected `float` >"),
        ({"tune": {"controllers.lpv-mpc.qp.max_iterations": {"uniform": [1, 900]}}}, "max_iterations = 1.0: .*`int`"),
        ({"fly": TABLES["fly"] | {f"{WEIGHTS}.rate": 0.02}}, f"{RATE} is given twice: remove it from"),
        ({"grid": {"track": ["hover"], "profile": ["flight", "thesis"]}}, "profile: only one can be tuned"),
        ({"grid": {"track": ["hover"], "law": {"own": {"profile": "thesis"}}}}, "profile: only one can be tuned"),
        ({"grid": {"track": ["hover"], "law": {"own": {f"{WEIGHTS}.rate": 1}}}}, f"{RATE} is given twice: remove it"),
        ({"grid": {}}, "no track: add one"),
        ({"objectives": {}}, "objectives: none: add"),
        ({"objectives": {"rmse": "mean"}}, 'objectives: unknown metric "rmse"'),
        ({"objectives": {"rmse_m": "best"}}, "objectives: rmse_m: choose mean, rms, median, largest or "),
        ({"objectives": {"rmse_m": {"quantile": 90}}}, "objectives: rmse_m: quantile: expected 0 to 1, not 90"),
        ({"objectives": {"share_lost": "median"}}, "objectives: share_lost is a mean"),
        (
            {"objectives": {"lost_at_s": "mean"}},
            "objectives: lost_at_s is not an objective to minimise: choose share_lost",
        ),
        (
            {"objectives": {"rmse_m": "mean", "share_lost": "mean"}, "prune_after": 2},
            "prune_after: with several objectives",
        ),
        ({"check_seeds": "4-9"}, "check_seeds: 4 is among seeds: tuning must never have seen"),
        ({"check_seeds": "9-4"}, "check_seeds: must be FIRST-LAST, a number, or a list of different numbers, not .9-4"),
        ({"check_seeds": 9}, "check_seeds: one seed gives no interval"),
        ({"seeds": "4-1"}, "seeds: must be FIRST-LAST"),
        ({"trials": 1}, "trials: must be at least 2, not 1"),
        ({"prune_after": -1}, "prune_after: must be at least 0, not -1"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(colibri.Error, match=said) as refused:
        planned(**tables)
    assert "\n" not in str(refused.value)


def test_trials_fly_every_combination_by_some_seeds_at_a_time() -> None:
    steps = planned(**TRACKS, seeds="1-5", prune_after=2).steps()
    assert [[(point.seed, point.factors["track"]) for point in points] for points in steps] == [
        [(1, "hover"), (1, "spiral"), (2, "hover"), (2, "spiral")],
        [(3, "hover"), (3, "spiral"), (4, "hover"), (4, "spiral")],
        [(5, "hover"), (5, "spiral")],
    ]


@pytest.mark.parametrize(("seeds", "after"), [("1-3", 0), ("1-4", 3), ("1-20", 5)])
def test_a_quarter_of_the_seeds_is_flown_before_a_trial_may_end(seeds: str, after: int) -> None:
    assert planned(seeds=seeds, prune_after=None).prune_after == after
    assert planned(seeds=seeds, prune_after=None, objectives={"rmse_m": "mean", "share_lost": "mean"}).prune_after == 0


def test_it_begins_with_the_profile_as_it_is() -> None:
    tune = {
        f"{WEIGHTS}.position": {"uniform": [1, 200]},
        f"{WEIGHTS}.rate*": {"log-uniform": [0.1, 10]},
        "controllers.lpv-mpc.plan.blocks.5": {"integers": [8, 12]},
        "controllers.lpv-mpc.qp.solver": {"choice": ["daqp", "clarabel"]},
    }
    tuning = planned(tune=tune)
    assert list(tuning.begins.values()) == [100.0, 1.0, 10, "daqp"]
    profile = tuning.tuned(dict(zip(tuning.space, (50.0, 2.0, 9, "clarabel"), strict=True)))
    law = profile.controllers["lpv-mpc"]
    assert (law["weights"]["position"], law["weights"]["rate"]) == (50.0, 0.03)
    assert (law["plan"]["blocks"], law["qp"]["solver"]) == ([1, 2, 3, 5, 7, 9], "clarabel")


def test_keywords_take_precedence_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "gusts.toml"
    file.write_text('trials = 7\nseeds = "1-2"\n[fly]\nduration = 3\nturbulence = "light"\n', encoding="utf-8")
    tables = tables_of(TuningTables, file, {"trials": 9, "fly": {"duration": 5}})
    assert (tables.name, tables.trials, tables.seeds) == ("gusts", 9, "1-2")
    assert tables.fly == {"duration": 5, "turbulence": "light"}
    grid = tables_of(TuningTables, file, {"grid": {"turbulence": ["light", "severe"]}})
    assert (grid.fly, grid.grid) == ({"duration": 3}, {"turbulence": ["light", "severe"]})
    with pytest.raises(colibri.Error, match='unknown option "trails"'):
        tables_of(TuningTables, file, {"trails": 9})
    file.write_text("trails = 7\n", encoding="utf-8")
    with pytest.raises(colibri.Error, match=r"gusts.toml: .*trails"):
        tables_of(TuningTables, file, {})
