"""A planned flight and how it is flown: in this process, as two, as a fleet, or again from its log."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.flights.fly import fly_plan, prepare
    from colibri.flights.plan import FlightPlan, PlanError, Summary
    from colibri.flights.processes import FlightError
    from colibri.flights.replay import Difference, Replayed, ReplayError, replay_flight
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.flights.fly": "fly_plan prepare",
            "colibri.flights.plan": "FlightPlan PlanError Summary",
            "colibri.flights.processes": "FlightError",
            "colibri.flights.replay": "Difference ReplayError Replayed replay_flight",
        },
    )

__all__ = [
    "Difference",
    "FlightError",
    "FlightPlan",
    "PlanError",
    "ReplayError",
    "Replayed",
    "Summary",
    "fly_plan",
    "prepare",
    "replay_flight",
]
