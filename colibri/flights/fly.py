"""Fly a plan over its link; over UDP as two processes."""

from collections.abc import Callable, Iterable
from time import monotonic

from colibri.common.errors import InFlightError, checked
from colibri.common.process.failure_file import keep_failure, kept_failure
from colibri.common.process.lifecycle import EXIT_FAILED, loading
from colibri.flights.launcher import Child, end_children, events_of, how_it_ended
from colibri.flights.plan import FlightPlan, FrameCount, PlanError, unseen
from colibri.flights.provenance import write_provenance
from colibri.mavlink.ulog.log import TopicLog

_SHOWN = ("ground", "heard", "said")  # events of the autopilot shown to a user with ground stations
_STOPPED_S = 10.0
_SILENT_S = 60.0
_BY_SIGNAL = 128


class FlightError(InFlightError):
    """A process ended before its flight did; `said` if it has printed the reason."""

    def __init__(self, message: str, code: int = EXIT_FAILED, *, said: bool = False) -> None:
        super().__init__(message)
        self.code, self.said = code, said


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

    if compiling is not unseen:
        on_compile(compiling)
    try:
        return fly_locally(plan, progress, topics)
    except InFlightError as error:
        folder = plan.out if topics is None else None
        raise FlightError(keep_failure(error, folder)) from error


def fly_processes(
    plan: FlightPlan,
    progress: Callable[[float], None] = unseen,
    say: Callable[[str], None] = unseen,
    compiling: Callable[[int], None] = unseen,
) -> FrameCount:
    children: dict[str, Child] = {}
    compiled: dict[str, int] = {}
    summary: FrameCount | None = None
    stopped, silent = _Wait(_STOPPED_S), _Wait(_SILENT_S)
    try:
        children["plant"] = Child(plan.plant_spec("udpin:127.0.0.1:0"), fork=True)
        over = False
        while not over:
            over = any(child.code() is not None for child in children.values())
            for child, event in events_of(children.values()):
                kind = event["event"]
                if kind == "compiling":
                    silent.end()
                    compiled[child.name] = event["functions"]
                    compiling(sum(compiled.values()))
                elif child.name == "autopilot":
                    if kind in _SHOWN:
                        say(event["text"])
                elif kind == "listening":
                    autopilot = plan.autopilot_spec(event["url"].replace("udpin", "udpout"))
                    children["autopilot"] = Child(autopilot, fork=True)
                elif kind == "progress":
                    progress(event["sim_time_s"])
                elif kind in ("silence", "answered"):
                    if not compiled:  # which takes long, and is shown
                        say(event["text"])
                    (silent.begin if kind == "silence" else silent.end)()
                elif kind == "ended":
                    summary = FrameCount(event["wall_time_s"], event["frames"], event["resent"])
            held = [child.name for child in children.values() if child.is_stopped()]
            (stopped.begin if held else stopped.end)()
            if stopped.is_over():
                raise FlightError(f"the {held[0]} was stopped for {_STOPPED_S:.0f} s")
            if silent.is_over() and not held:
                raise FlightError(f"the autopilot did not answer for {_SILENT_S:.0f} s")
        if summary and children["plant"].code() == 0:
            return summary
        raise _failure(children.values(), plan)
    finally:
        end_children(children.values())


class _Wait:
    """A bounded wait; time for which this process is stopped does not count."""

    def __init__(self, allowed_s: float) -> None:
        self._allowed_s = allowed_s
        self._waits = False
        self._waited_s = self._looked_s = 0.0

    def begin(self) -> None:
        if not self._waits:
            self._waits, self._waited_s, self._looked_s = True, 0.0, monotonic()

    def end(self) -> None:
        self._waits = False

    def is_over(self) -> bool:
        now_s = monotonic()
        self._waited_s += min(now_s - self._looked_s, 1.0)
        self._looked_s = now_s
        return self._waits and self._waited_s > self._allowed_s


def _failure(children: Iterable[Child], plan: FlightPlan) -> FlightError:
    for child in children:
        code = child.code()
        if code:
            said = 0 < code < _BY_SIGNAL
            why = kept_failure(plan.out) or f"the {child.name} {how_it_ended(code)}"
            return FlightError(why, code if said else EXIT_FAILED, said=said)
    return FlightError("a process ended before the flight did")
