from typing import Any

import pytest

import colibri
from colibri.campaigns.definition import Metric
from colibri.campaigns.flights import Verdict
from colibri.tuning.definition import Objective, TuningError, metrics_of, read_objectives
from tests.support.tuning import flown

METRICS = (Metric("effort_n_m"), Metric("rmse_m"))
RMSE = Objective("rmse_m")


@pytest.mark.parametrize(
    ("pooling", "name", "pooled"),
    [
        ("mean", "rmse_m, mean", 4.0),
        ("rms", "rmse_m, rms", 5.0),
        ("median", "rmse_m, median", 3.0),
        ("largest", "rmse_m, largest", 9.0),
        ({"quantile": 0.75}, "rmse_m, quantile 0.75", 4.5),
    ],
)
def test_flights_are_pooled(pooling: Any, name: str, pooled: float) -> None:
    (objective,) = read_objectives({"rmse_m": pooling}, METRICS)
    assert objective.name == name
    values = objective.of_flights([flown(0.0, value) for value in (1.0, 9.0, 3.0, 3.0)], METRICS, worst=100.0)
    assert objective.pooled(values) == pytest.approx(pooled)


def test_a_lost_flight_costs_ten_times_the_worst() -> None:
    before = [flown(0.0, 0.5), flown(0.0, 2.0), flown(0.0, 900.0, verdict=Verdict.LOST)]
    worst = RMSE.worst(before, METRICS)
    assert worst == 20.0
    lost = [flown(0.0, 0.1, verdict=verdict) for verdict in Verdict if verdict is not Verdict.FLOWN]
    others = [flown(0.0, None), flown(0.0, 30.0), flown(0.0, 0.1)]
    assert RMSE.of_flights([*lost, *others], METRICS, worst).tolist() == [20.0] * 6 + [0.1]
    assert RMSE.worst([flown(0.0, 0.0)], METRICS) == 10.0


def test_share_lost() -> None:
    (objective,) = read_objectives({"share_lost": "mean"}, METRICS)
    values = objective.of_flights([flown(), flown(), flown(verdict=Verdict.LOST), flown()], METRICS, worst=1.0)
    assert objective.pooled(values) == 0.25


def test_the_profile_as_it_is_must_be_measurable() -> None:
    with pytest.raises(TuningError, match="no flight of the profile as it is came through: why"):
        RMSE.worst([flown(0.0, 1.0, verdict=Verdict.LOST)], METRICS)
    with pytest.raises(TuningError, match="rmse_m is missing in some flights: fly longer"):
        RMSE.worst([flown(0.0, 1.0), flown(0.0, None)], METRICS)
    with pytest.raises(TuningError, match=r"rmse_m is -0\.5 in a flight: an objective must not be below zero"):
        RMSE.worst([flown(0.0, 1.0), flown(0.0, -0.5)], METRICS)


def test_what_objectives_need_is_kept_and_one_may_be_a_function() -> None:
    def sunk(_flight: object) -> float:
        return 0.0

    own = (Metric("sunk", sunk), Metric("rmse_m"))
    objectives = read_objectives({"effort_n_m": "mean", "sunk": "largest", "share_lost": "mean"}, own)
    kept = metrics_of(objectives, own)
    assert [metric.name for metric in kept] == ["effort_n_m", "sunk", "rmse_m"]
    assert kept[1].of is sunk


def test_the_solvers_work_is_an_objective_that_no_clock_measures() -> None:
    hover = {"duration": 0.3, "start": {"x": 0.4, "z": 2.0}}
    (metric,) = metrics_of(read_objectives({"qp_iterations.mean": "mean"}, ()), ())
    worked, again, without = (
        metric.value(colibri.fly("hover", **hover, **law)) for law in ({}, {}, {"controller": "geometric-se3"})
    )
    assert worked == again
    assert worked is not None
    assert worked > 0.0
    assert without is None
