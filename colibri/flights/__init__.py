"""Fly a described flight in one process, two processes or a fleet, or replay its log."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.flights.effects import NoEffectWarning as NoEffectWarning
    from colibri.flights.fly import FlightError as FlightError
    from colibri.flights.fly import fly_plan as fly_plan
    from colibri.flights.folder import prepare as prepare
    from colibri.flights.plan import FlightPlan as FlightPlan
    from colibri.flights.plan import FrameCount as FrameCount
    from colibri.flights.plan import PlanError as PlanError
    from colibri.flights.replay import Difference as Difference
    from colibri.flights.replay import Replayed as Replayed
    from colibri.flights.replay import ReplayError as ReplayError
    from colibri.flights.replay import replay_flight as replay_flight
    from colibri.flights.spec import FlightSpec as FlightSpec
    from colibri.flights.spec import OptionError as OptionError
else:
    __getattr__, __dir__ = public(__name__)
