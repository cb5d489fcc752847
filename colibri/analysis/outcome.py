"""What is kept of a flight: `flight.csv` and `report.json`."""

from colibri.analysis.recording import Recording, RecordingError, read_recording, write_recording
from colibri.analysis.report import Report, report, write_report
from colibri.flights.plan import FlightPlan, Summary


def keep_flight(plan: FlightPlan, summary: Summary) -> tuple[Recording, Report]:
    """Write `flight.csv` and `report.json` of a flight that ended well; return both."""
    recording = read_recording(plan)
    figures = report(plan, summary, recording)
    write_recording(recording, plan.out / "flight.csv")
    write_report(figures, plan.out / "report.json")
    return recording, figures


def keep_what_there_is(plan: FlightPlan) -> Recording | None:
    """Write what there is of a flight that did not end well."""
    try:
        recording = read_recording(plan)
    except (RecordingError, OSError):
        return None
    write_recording(recording, plan.out / "flight.csv")
    return recording
