import sys
from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.campaigns.flights import Verdict
from colibri.tuning.results import TuningResults
from colibri.tuning.run import TrialFlights, fly_tuning
from tests.support.campaigns import Here, tables_in
from tests.support.commands import Refused
from tests.support.tuning import FILE, POSITION, RATE, TABLES, WEIGHTS, files_in, planned, tuned


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tuned") / "out"


@pytest.fixture(scope="module")
def results(folder: Path) -> TuningResults:
    return tuned(folder, trials=9, check_seeds="11-13", grid={"track": ["hover", "hover:height=2.2"]})


def test_it_finds_what_is_better_and_shows_it_by_other_seeds(results: TuningResults) -> None:
    assert [trial.number for trial in results.trials] == list(range(9))
    assert results.best.values[0] == min(trial.values[0] for trial in results.trials) < results.trials[0].values[0]
    assert results.is_better
    assert [(each.what, each.where) for each in results.verdict[:3]] == [
        ("rmse_m, mean", "all"),
        ("rmse_m, mean", "hover"),
        ("rmse_m, mean", "hover:height=2.2"),
    ]
    assert results.verdict[0].change < 0.0
    assert results.verdict[0].seeds == 3


def test_what_it_writes(results: TuningResults, folder: Path) -> None:
    names = {path.name for path in folder.iterdir()}
    pictures = {"history.png", "importance.png", "slices.png"}
    assert pictures | {"profile.toml", "trials.csv", "trials.log", "tuning.json", "verdict.csv"} <= names
    rows = (folder / "trials.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == f'trial,state,flights,lost,"rmse_m, mean",{POSITION},{RATE}'
    assert len(rows) == 10
    assert rows[1].startswith("0,flown,8,0,")
    assert rows[1].endswith(",100.0,0.015")
    assert [row.split(",")[1] for row in rows].count("chosen") == 1
    assert len((folder / "verdict.csv").read_text(encoding="utf-8").splitlines()) == 1 + len(results.verdict)
    flights, _ = tables_in(folder / "check" / f"trial-{results.best.number}")
    assert len(flights.splitlines()) == 1 + 2 * 2 * 3
    assert "flight-tuned" in flights


def test_the_tuned_profile_names_its_origin_and_flies(results: TuningResults, folder: Path) -> None:
    text = (folder / "profile.toml").read_text(encoding="utf-8")
    assert text == results.profile_text
    first, second, third = text.splitlines()[:3]
    assert first.startswith("# Profile flight, tuned by `colibri tune` ")
    assert first.endswith(f": trial {results.best.number} of 9 of short.")
    assert second.endswith("turbulence moderate, track hover hover:height=2.2; seeds 1-4.")
    assert third.startswith("# rmse_m, mean: ")
    options: dict[str, Any] = TABLES["fly"] | {"seed": 11}
    flown = colibri.fly("hover", profile=str(folder / "profile.toml"), **options)
    assert flown.sha256 == colibri.fly("hover", profile=results.profile, **options).sha256
    assert flown.sha256 != colibri.fly("hover", profile="flight", **options).sha256
    assert results.checked is not None
    after = [each.sha256 for each in results.checked.flown[6:]]
    assert flown.sha256 == after[0]


def test_it_goes_on_and_nothing_changes(results: TuningResults, folder: Path) -> None:
    before = files_in(folder)
    again = tuned(folder, resume=True, trials=9, check_seeds="11-13", grid={"track": ["hover", "hover:height=2.2"]})
    assert files_in(folder) == before
    assert [each.row for each in again.verdict] == [each.row for each in results.verdict]


def test_a_folder_with_something_else_is_left_alone(folder: Path, results: TuningResults, tmp_path: Path) -> None:
    given: dict[str, Any] = {"trials": 9, "check_seeds": "11-13", "grid": {"track": ["hover", "hover:height=2.2"]}}
    with pytest.raises(colibri.Error, match="has this tuning already: continue with --resume"):
        tuned(folder, **given)
    with pytest.raises(colibri.Error, match=r"has another tuning \(root_seed differ\): choose another folder"):
        tuned(folder, resume=True, root_seed=3, **given)
    space = {f"{WEIGHTS}.position": {"log-uniform": [1, 1001]}, f"{WEIGHTS}.rate": {"log-uniform": [0.001, 1.0]}}
    with pytest.raises(colibri.Error, match=r"has another tuning \(tune differ\): choose another folder"):
        tuned(folder, resume=True, tune=space, **given)
    assert len(results.trials) == 9
    (tmp_path / "thesis.tex").write_text("", encoding="utf-8")
    with pytest.raises(colibri.Error, match="is not empty and does not contain a tuning: choose another folder"):
        tuned(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.long
def test_a_trial_that_is_clearly_worse_ends_early(tmp_path: Path) -> None:
    space = {f"{WEIGHTS}.position": {"log-uniform": [0.01, 1000]}}
    results = tuned(tmp_path, seeds="1-8", trials=6, prune_after=5, tune=space)
    pruned = [trial for trial in results.trials if trial.pruned]
    assert pruned
    assert {trial.flights for trial in pruned} <= {5}
    whole = [trial for trial in results.trials if not trial.pruned]
    assert all(trial.flights == 8 for trial in whole)
    assert not results.best.pruned
    assert min(trial.values[0] for trial in pruned) >= results.best.values[0]
    for trial in pruned:  # what was expected of it is what it would have come to
        tuning = planned(seeds="1-8", tune=space)
        with TrialFlights(Here(), tuning.common) as flights:
            points = [point._replace(factors=point.factors | trial.params) for point in tuning.campaign.points()]
            values = tuning.objectives[0].of_flights(flights.fly(points), tuning.campaign.metrics, 1e9)
        assert trial.values[0] == pytest.approx(values.mean(), rel=0.05)


@pytest.mark.long
def test_several_objectives_have_a_pareto_front(tmp_path: Path) -> None:
    results = tuned(tmp_path, trials=8, objectives={"rmse_m": "mean", "effort_n_m": {"quantile": 0.9}})
    assert len(results.front) > 1
    for one in results.front:
        assert not any(
            all(a <= b for a, b in zip(other.values, one.values, strict=True)) and other.values != one.values
            for other in results.trials
        )
    assert results.best in results.front
    for trial in results.front:
        profile = colibri.load_profile(str(tmp_path / "pareto" / f"trial-{trial.number}.toml"))
        assert profile.controllers == results.tuning.tuned(trial.params).controllers
    assert (tmp_path / "pareto.png").exists()
    assert list(results.importances) == ["rmse_m, mean", "effort_n_m, quantile 0.9"]


def test_where_nothing_is_better_the_profile_stays(tmp_path: Path) -> None:
    space = {f"{WEIGHTS}.position": {"uniform": [0.1, 100]}}
    results = tuned(tmp_path, tune=space, check_seeds="11-13", trials=3)
    assert results.best.number == 0
    assert not results.verdict
    kept = colibri.load_profile(str(tmp_path / "profile.toml"))
    assert kept.controllers == results.tuning.base.replace(f"{WEIGHTS}.position", 100.0).controllers


def test_a_trial_that_cannot_be_flown_counts_as_lost(tmp_path: Path) -> None:
    space = {f"{WEIGHTS}.position": {"uniform": [0.1, 100]}}

    class Refuses(Here):
        def each(self, work: Any, common: Any, jobs: Any) -> Any:
            flown: Any
            for job, flown in super().each(work, common, jobs):
                bad = job.factors[POSITION] < 100.0
                yield job, flown._replace(verdict=Verdict.REFUSED, metrics=(None,)) if bad else flown

    results = fly_tuning(planned(tune=space, trials=3), Refuses, tmp_path)
    first, *others = results.trials
    assert [trial.lost for trial in results.trials] == [0, 4, 4]
    assert all(trial.values[0] > 5.0 * first.values[0] for trial in others)


def test_from_python_with_a_profile_and_a_metric_of_one_s_own() -> None:
    profile = colibri.load_profile("flight").replace(f"{WEIGHTS}.velocity", 2.0)
    results = colibri.tune(
        fly=TABLES["fly"] | {"track": "hover", "profile": profile},
        tune={f"{WEIGHTS}.position": {"log-uniform": [1, 1000]}},
        objectives={"sunk": "mean"},
        metrics={"sunk": lambda flight: 1.0 + flight.samples["z"][0] - flight.samples["z"][-1]},
        seeds=range(2),
        trials=2,
        workers=1,
    )
    assert [trial.number for trial in results.trials] == [0, 1]
    assert "velocity = 2.0" in results.profile_text
    assert results.plot("history").axes
    with pytest.raises(
        colibri.TuningError, match=r'unknown figure of these trials "importance" \(choose history, slices'
    ):
        results.plot()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--trials", "1"], "trials: must be at least 2, not 1"),
        (["--workers", "0"], "workers: must be a whole number of at least 1, not 0"),
        (["--workers", "2", "--dask", "tcp://127.0.0.1:1"], "workers: not used with a cluster"),
    ],
)
def test_bad_input_is_refused_in_one_line(options: list[str], said: str, tmp_path: Path, refused: Refused) -> None:
    file = tmp_path / "short.toml"
    file.write_text(FILE.format(trials=3), encoding="utf-8")
    assert refused("tune", file, *options, "--out", tmp_path / "out").startswith(said)
    assert not (tmp_path / "out").exists()


def test_without_optuna_the_extra_is_named(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert refused("tune", "short.toml") == "optuna is not installed: pip install colibri-sitl[tune]"
