"""Tunings of flights so short that a test can have many."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colibri.campaigns.flights import FlightResult, Verdict
from colibri.tuning.definition import Tuning, TuningTables, tuning_of
from colibri.tuning.results import TuningResults
from colibri.tuning.run import fly_tuning
from tests.support.campaigns import Here

WEIGHTS = "controllers.lpv-mpc.weights"
POSITION, RATE = f"profile.{WEIGHTS}.position", f"profile.{WEIGHTS}.rate"
TABLES: dict[str, Any] = {
    "name": "short",
    "seeds": "1-4",
    "trials": 4,
    "prune_after": 0,
    "metrics": ["rmse_m"],
    "fly": {"duration": 0.2, "start": {"x": 0.1, "z": 2.0}, "turbulence": "moderate"},
    "grid": {"track": ["hover"]},
    "tune": {f"{WEIGHTS}.position": {"log-uniform": [1, 1000]}, f"{WEIGHTS}.rate": {"log-uniform": [0.001, 1.0]}},
    "objectives": {"rmse_m": "mean"},
}

FILE = """
name = "short"
trials = {trials}
seeds = "1-4"
prune_after = 0
metrics = ["rmse_m"]
[fly]
duration = 0.2
start = {{ x = 0.1, z = 2.0 }}
turbulence = "moderate"
[grid]
track = ["hover"]
[tune]
"controllers.lpv-mpc.weights.position" = {{ log-uniform = [1, 1000] }}
"controllers.lpv-mpc.weights.rate" = {{ log-uniform = [0.001, 1.0] }}
[objectives]
rmse_m = "mean"
"""
"""The same as a file, but for how many trials."""


def planned(**tables: Any) -> Tuning:
    return tuning_of(TuningTables(**(TABLES | tables)))


def tuned(out: Path, resume: bool = False, **tables: Any) -> TuningResults:
    return fly_tuning(planned(**tables), Here, out, resume=resume)


def files_in(folder: Path) -> Mapping[str, str]:
    """Return what must be the same however a tuning was flown."""
    return {name: (folder / name).read_text(encoding="utf-8") for name in ("profile.toml", "trials.csv")}


def flown(*metrics: float | None, verdict: Verdict = Verdict.FLOWN, flight: int = 0) -> FlightResult:
    return FlightResult(flight, verdict, "" if verdict is Verdict.FLOWN else "why", metrics, "")
