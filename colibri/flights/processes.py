"""A flight as two processes over UDP."""

from collections.abc import Callable, Iterable

from colibri.common.errors import InFlightError
from colibri.common.process.failure_file import kept_failure
from colibri.flights.launcher import Child, end_children, events_of, how_it_ended
from colibri.flights.plan import FlightPlan, Summary, unseen

_SHOWN = ("ground", "heard", "said")
"""Events of the autopilot shown to a user with ground stations."""


class FlightError(InFlightError):
    """A process ended before its flight did; `said` if it has printed the reason."""

    def __init__(self, message: str, code: int, *, said: bool) -> None:
        super().__init__(message)
        self.code = code
        self.said = said


def fly_processes(
    plan: FlightPlan,
    progress: Callable[[float], None] = unseen,
    say: Callable[[str], None] = unseen,
    compiling: Callable[[int], None] = unseen,
) -> Summary:
    """Fly on a free port, as `fly_plan` does."""
    children: dict[str, Child] = {}
    compiled: dict[str, int] = {}
    try:
        children["plant"] = Child(plan.plant_spec("udpin:127.0.0.1:0"), fork=True)
        over = False
        while not over:
            over = any(child.code() is not None for child in children.values())
            for child, event in events_of(children.values()):
                if event["event"] == "compiling":
                    compiled[child.name] = event["functions"]
                    compiling(sum(compiled.values()))
                elif child.name == "autopilot":
                    if event["event"] in _SHOWN:
                        say(event["text"])
                elif event["event"] == "listening":
                    autopilot = plan.autopilot_spec(event["url"].replace("udpin", "udpout"))
                    children["autopilot"] = Child(autopilot, fork=True)
                elif event["event"] == "progress":
                    progress(event["sim_time_s"])
                elif event["event"] == "ended":
                    return Summary(event["wall_time_s"], event["frames"], event["resent"])
        raise _failure(children.values(), plan)
    finally:
        end_children(children.values())


def _failure(children: Iterable[Child], plan: FlightPlan) -> FlightError:
    for child in children:
        code = child.code()
        if code:
            why = kept_failure(plan.out) or f"the {child.name} {how_it_ended(code)}"
            return FlightError(why, max(code, 1), said=code > 0)
    return FlightError("a process ended before the flight did", 1, said=False)
