"""Results of a flight, in files or in memory."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from colibri.analysis.logs import RecordingError, log_of
from colibri.analysis.lost import Lost, lost, read_flight
from colibri.analysis.recording import FlightReader, Samples, TableWriter
from colibri.analysis.report import Report, encoded_report, report, write_report
from colibri.common.errors import InFlightError
from colibri.common.process.failure_file import FAILURE, failure_text
from colibri.flights.fly import fly_plan
from colibri.flights.folder import PROVENANCE
from colibri.flights.plan import FlightPlan, FrameCount
from colibri.flights.provenance import encoded_provenance
from colibri.mavlink.ulog.log import MemoryLog, TopicReader
from colibri.mavlink.ulog.reader import FILE, LogFormatError

TABLE, REPORT = "flight.csv", "report.json"


class Outcome(NamedTuple):
    """A result; `report` is `None` before the first control sample, `error` ended the flight early."""

    report: Report | None
    log: TopicReader
    error: InFlightError | None
    failure_text: str

    @property
    def failure(self) -> str:
        """Reason of an early end."""
        return self.failure_text.partition("\n")[0]

    @property
    def lost(self) -> str:
        """Reason of the vehicle's loss."""
        return self.failure or (self.report and self.report["lost"]) or ""


def fly_to_its_end(plan: FlightPlan, *, for_viewers: bool = False, failure_file: str = FAILURE) -> Outcome:
    """Fly and judge, also a flight that ends early."""
    if plan.spec.link != "udp":
        log = MemoryLog(for_viewers=for_viewers)
        try:
            summary = fly_plan(plan, topics=log)
        except InFlightError as error:
            cause = error.__cause__
            _, text = failure_text(cause if isinstance(cause, InFlightError) else error, failure_file)
            return _early(plan, log, error, text)
        return Outcome(report_of(plan, log, summary), log, None, "")
    with TemporaryDirectory(prefix="colibri-") as folder:
        plan = replace(plan, spec=replace(plan.spec, out=Path(folder)))
        try:
            summary = fly_plan(plan)
        except InFlightError as error:
            file = Path(folder) / FAILURE
            text = file.read_text(encoding="utf-8") if file.exists() else str(error)
            return _early(plan, log_of(plan.out), error, text.replace(str(file), failure_file))
        file_log = log_of(plan.out)
        return Outcome(report_of(plan, file_log, summary), file_log, None, "")


def _early(plan: FlightPlan, log: TopicReader, error: InFlightError, text: str) -> Outcome:
    found = None
    with suppress(RecordingError):
        found = report_of(plan, log, None, text.partition("\n")[0])
    return Outcome(found, log, error, text)


def report_of(
    plan: FlightPlan,
    log: TopicReader,
    summary: FrameCount | None,
    failure: str | None = None,
    *others: Callable[[Samples], None],
) -> Report:
    flight = read_flight(FlightReader(plan, log), *others)
    gone = lost(plan, flight) if failure is None else Lost(float(flight.t[-1]), failure)
    return report(plan, log, summary, flight, gone)


def keep_flight(
    plan: FlightPlan, summary: FrameCount | None, *others: Callable[[Samples], None], failure: str | None = None
) -> Report:
    """Write `flight.csv` and `report.json` of a flight."""
    with (plan.out / TABLE).open("wb") as file:
        found = report_of(plan, log_of(plan.out), summary, failure, TableWriter(file, plan).add, *others)
    write_report(found, plan.out / REPORT)
    return found


def keep_what_there_is(plan: FlightPlan, why: str | None = None) -> Report | None:
    """Write the table of an incomplete flight, and its report if `why` is known."""
    with suppress(RecordingError, LogFormatError, OSError):
        if why is not None:
            return keep_flight(plan, None, failure=why)
        with (plan.out / TABLE).open("wb") as file:
            read_flight(FlightReader(plan), TableWriter(file, plan).add)
    return None


def files_of(plan: FlightPlan, report: Report | None, log: TopicReader) -> Iterator[tuple[str, bytes]]:
    yield PROVENANCE, encoded_provenance(plan)
    yield FILE, b"".join(log.encoded())
    if report is not None:
        table = BytesIO()
        writer = TableWriter(table, plan)
        for part in FlightReader(plan, log):
            writer.add(part)
        yield TABLE, table.getvalue()
        yield REPORT, encoded_report(report)
