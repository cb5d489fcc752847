"""Flights from a script or notebook."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.experiments.flight import Flight as Flight
    from colibri.experiments.flight import SampleTable as SampleTable
    from colibri.experiments.flight import fly as fly
    from colibri.experiments.flight import load_flight as load_flight
    from colibri.flights.spec import OptionError as OptionError
else:
    __getattr__, __dir__ = public(__name__)
