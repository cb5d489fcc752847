"""Largest age of each report that a companion uses: one table for the start and for the flight."""

from collections.abc import Mapping
from math import inf
from typing import NamedTuple

from colibri.mavlink.client.report import VehicleReport


class Age(NamedTuple):
    """A row of the table: a report, its messages, and its largest age at the start and in flight, s.

    A vehicle that never sends a `needed` one is not flown.
    """

    name: str
    messages: str
    start_s: float
    flight_s: float
    needed: bool = False


AGES: tuple[Age, ...] = (
    Age("clock", "TIMESYNC", 1.0, 3.0),
    Age("heartbeat", "HEARTBEAT", 5.0, 5.0),
    Age("mode", "CURRENT_MODE or HEARTBEAT", 2.5, 2.5),
    Age("estimator", "ESTIMATOR_STATUS or SYS_STATUS", 2.0, 3.0),
    Age("status", "SYS_STATUS", 3.0, 5.0),
    Age("battery", "SYS_STATUS or BATTERY_STATUS", 5.0, 10.0),
    Age("landed", "EXTENDED_SYS_STATE", 2.0, inf, needed=True),
    Age("altitude", "GLOBAL_POSITION_INT", 2.0, inf),
)
"""Age of states (attitude, body rates, position, velocity): `FlightLimits.max_state_age_s`."""


def ages_s(report: VehicleReport, answered_us: int | None, now_us: int) -> dict[str, float]:
    """Return the age of each report that the vehicle has sent; `answered_us` is of the last TIMESYNC."""
    reported = report.reported_us if answered_us is None else {**report.reported_us, "clock": answered_us}
    return {name: (now_us - at_us) * 1e-6 for name, at_us in reported.items()}


def too_old(ages: Mapping[str, float], *, in_flight: bool) -> list[str]:
    """Say which reports are too old. One that was never sent is not: see `missing` and `needed`."""
    limits = ((row, row.flight_s if in_flight else row.start_s) for row in AGES)
    return [
        f"the last {row.name} report ({row.messages}) is {ages[row.name]:.1f} s old, more than {limit_s:g}"
        for row, limit_s in limits
        if ages.get(row.name, 0.0) > limit_s
    ]


def missing(ages: Mapping[str, float], *, needed: bool = False) -> list[str]:
    return [f"{row.name} ({row.messages})" for row in AGES if row.name not in ages and row.needed == needed]
