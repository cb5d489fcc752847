"""Fly a plan over its link."""

from collections.abc import Callable

from colibri.common.errors import InFlightError, checked
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import loading
from colibri.flights.plan import FlightPlan, FrameCount, PlanError, unseen
from colibri.flights.processes import FlightError, fly_processes
from colibri.flights.provenance import write_provenance
from colibri.mavlink.ulog.log import TopicLog


def fly_plan(
    plan: FlightPlan,
    progress: Callable[[float], None] = unseen,
    say: Callable[[str], None] = unseen,
    compiling: Callable[[int], None] = unseen,
    topics: TopicLog | None = None,
) -> FrameCount:
    """Fly a plan over its link and write its provenance; with `topics` no files are written.

    Args:
        progress: Called with the simulated time, s.
        say: Called with a line per ground link and ground station.
        compiling: Called with the number of functions compiled so far.

    Raises:
        FlightError: The flight ended early; the reason is also in `FAILURE`.
    """
    checked("plan", plan, FlightPlan, "a FlightPlan, as of FlightPlan.of", PlanError)
    if topics is None:
        write_provenance(plan)
    if plan.spec.link == "udp":
        return fly_processes(plan, progress, say, compiling)
    with loading():
        from colibri.common.jit import on_compile
        from colibri.flights.in_process import fly_locally

    on_compile(compiling)
    try:
        return fly_locally(plan, progress, topics)
    except InFlightError as error:
        folder = plan.out if topics is None else None
        raise FlightError(keep_failure(error, folder)) from error
