"""What is kept of a flight: `flight.csv` and `report.json`."""

from typing import NamedTuple

from colibri.analysis.lost import Lost, lost
from colibri.analysis.recording import Recording, RecordingError, read_recording, write_recording
from colibri.analysis.report import Report, report, write_report
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
        return Outcome(keep_flight(plan, fly_plan(plan))[1], "")
    except InFlightError as error:
        return Outcome(keep_what_there_is(plan, str(error)), str(error))


def keep_flight(plan: FlightPlan, summary: Summary) -> tuple[Recording, Report]:
    """Write `flight.csv` and `report.json` of a flight that came to its end; return both."""
    recording = read_recording(plan)
    return recording, _keep(plan, recording, summary, lost(plan, recording))


def keep_what_there_is(plan: FlightPlan, why: str | None = None) -> Report | None:
    """Write what there is of a flight that came to no end; a report only where it is known `why`: it is lost then."""
    try:
        recording = read_recording(plan)
        if why is not None:
            return _keep(plan, recording, None, Lost(float(recording["t"][-1]), why))
        write_recording(recording, plan.out / "flight.csv")
    except (RecordingError, OSError):
        pass
    return None


def _keep(plan: FlightPlan, recording: Recording, summary: Summary | None, lost: Lost | None) -> Report:
    write_recording(recording, plan.out / "flight.csv")
    figures = report(plan, summary, recording, lost)
    write_report(figures, plan.out / "report.json")
    return figures
