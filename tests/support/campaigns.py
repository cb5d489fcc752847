"""Campaigns of flights so short that a test can have many, and an engine without processes."""

import subprocess
import sys
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

import colibri
from colibri.campaigns.definition import Campaign, CampaignTables, campaign_of
from colibri.campaigns.engines import Job, Killed, Result
from colibri.campaigns.flights import FlightResult, common_of, fly_point
from colibri.campaigns.journal import JOURNAL
from colibri.campaigns.results import CampaignResults

SHORT: dict[str, Any] = {"duration": 0.2, "start": {"x": 0.1, "z": 2.0}}
MASS = "plant-vehicle.body.mass_kg"
DRAWN = {MASS: {"uniform": [0.68, 0.74]}}


class Here:
    is_remote = False

    def each(
        self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]
    ) -> Generator[tuple[Job, Result | Killed], None, None]:
        for job in jobs:
            yield job, work(common, job)


def planned(**tables: Any) -> Campaign:
    tables.setdefault("grid", {"track": ["hover"]})
    return campaign_of(CampaignTables(**({"fly": SHORT} | tables)))


def flown(**tables: Any) -> list[FlightResult]:
    campaign = planned(**tables)
    common = common_of(campaign)
    return [fly_point(common, point) for point in campaign.points()]


def results(**tables: Any) -> CampaignResults:
    return CampaignResults(planned(**tables), dict(enumerate(flown(**tables))))


def tables_in(folder: Path) -> tuple[str, str]:
    return (folder / "flights.csv").read_text(encoding="utf-8"), (folder / "summary.csv").read_text(encoding="utf-8")


class Hovers:
    control_interval_us = 10_000
    preview = colibri.Preview(interval_us=10_000, samples=1)

    def __init__(self, table: dict[str, float], vehicle: colibri.Vehicle, _clock: object) -> None:
        self._speeds = np.full(4, vehicle.hover_speed * table.get("part", 1.0))

    def initial(self, _rotor_speed: float) -> None:
        return None

    def step(self, _memory: None, _time_us: int, state: colibri.VehicleState, _references: object) -> Any:
        return None, colibri.Decision(self._speeds, state.euler)


PATIENCE_S = 120.0


SEEDS = "0-39"


OPTIONS = ["--track", "hover", "--seeds", SEEDS, "--draw", f"{MASS}=uniform:0.68:0.74", "--duration", "0.6", "--quiet"]


def begin(out: Path, *options: str) -> subprocess.Popen[str]:
    words = [sys.executable, "-m", "colibri", "campaign", *OPTIONS, *options, "--out", str(out)]
    return subprocess.Popen(words, stderr=subprocess.PIPE, text=True)


def rows(out: Path, least: int) -> int:
    """Return how many rows are kept, when there are at least so many."""
    until_s = monotonic() + PATIENCE_S
    journal = out / JOURNAL
    while (count := journal.read_bytes().count(b"\n") if journal.exists() else 0) < least:
        assert monotonic() < until_s
        sleep(0.005)
    return count
