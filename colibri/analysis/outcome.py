"""What is kept of a flight: `flight.csv` and `report.json`."""

from collections.abc import Callable
from typing import NamedTuple

from colibri.analysis.lost import Lost, lost
from colibri.analysis.recording import FlightReader, RecordingError, Samples, TableFile
from colibri.analysis.report import Report, report, write_report
from colibri.analysis.series.flight_series import FlightSeries, read_flight
from colibri.common.errors import InFlightError
from colibri.flights.fly import fly_plan
from colibri.flights.folder import prepare
from colibri.flights.plan import FlightPlan, Summary


class Outcome(NamedTuple):
    """What came of a flight.

    Attributes:
        report: None where it ended before its first control sample.
        failure: Why it came to an early end; empty if it did not.
    """

    report: Report | None
    failure: str

    @property
    def lost(self) -> str:
        """Why the vehicle was lost; empty if it was not."""
        return self.failure or (self.report and self.report["lost"]) or ""


def fly_to_its_end(plan: FlightPlan) -> Outcome:
    """Fly into an empty folder and keep what came of it, also of a flight that ends early."""
    prepare(plan.out)
    try:
        return Outcome(keep_flight(plan, fly_plan(plan)), "")
    except InFlightError as error:
        return Outcome(keep_what_there_is(plan, str(error)), str(error))


def keep_flight(plan: FlightPlan, summary: Summary, *others: Callable[[Samples], None]) -> Report:
    """Write `flight.csv` and `report.json` of a flight that came to its end; return the report.

    `others` are handed each part of the flight on the way: what draws it, say.
    """
    flight = _write_table(plan, *others)
    return _write_report(plan, flight, summary, lost(plan, flight))


def keep_what_there_is(plan: FlightPlan, why: str | None = None) -> Report | None:
    """Write what there is of a flight that came to no end; a report only where it is known `why`: it is lost then."""
    try:
        flight = _write_table(plan)
        if why is not None:
            return _write_report(plan, flight, None, Lost(float(flight.t[-1]), why))
    except (RecordingError, OSError):
        pass
    return None


def _write_table(plan: FlightPlan, *others: Callable[[Samples], None]) -> FlightSeries:
    reader = FlightReader(plan)
    with TableFile(plan.out / "flight.csv") as table:
        return read_flight(reader, table.add, *others)


def _write_report(plan: FlightPlan, flight: FlightSeries, summary: Summary | None, lost: Lost | None) -> Report:
    figures = report(plan, summary, flight, lost)
    write_report(figures, plan.out / "report.json")
    return figures
