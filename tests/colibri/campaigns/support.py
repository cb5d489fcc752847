"""Campaigns of flights so short that a test can have many, and an engine without processes."""

from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any

from colibri.campaigns.definition import Campaign, CampaignTables, campaign_of
from colibri.campaigns.engines.engine import Job, Killed, Result
from colibri.campaigns.flights import Flown, common_of, fly_point
from colibri.campaigns.results import CampaignResults

SHORT: dict[str, Any] = {"duration": 0.2, "start": {"x": 0.1, "z": 2.0}}
MASS = "plant-vehicle.body.mass_kg"
DRAWN = {MASS: {"uniform": [0.68, 0.74]}}


class Here:
    """Does one job after the other, in this process."""

    def each(
        self, work: Callable[[Any, Job], Result], common: Any, jobs: Iterable[Job]
    ) -> Generator[tuple[Job, Result | Killed], None, None]:
        for job in jobs:
            yield job, work(common, job)


def planned(**tables: Any) -> Campaign:
    tables.setdefault("grid", {"track": ["hover"]})
    return campaign_of(CampaignTables(**({"fly": SHORT} | tables)))


def flown(**tables: Any) -> list[Flown]:
    """Return what comes of each flight."""
    campaign = planned(**tables)
    common = common_of(campaign)
    return [fly_point(common, point) for point in campaign.points()]


def results(**tables: Any) -> CampaignResults:
    return CampaignResults(planned(**tables), dict(enumerate(flown(**tables))))


def tables_in(folder: Path) -> tuple[str, str]:
    return (folder / "flights.csv").read_text(encoding="utf-8"), (folder / "summary.csv").read_text(encoding="utf-8")
