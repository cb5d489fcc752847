"""A flight as two processes over UDP: started, watched, ended."""

import signal
import subprocess
from collections.abc import Callable
from math import isfinite

from colibri.common.errors import InFlightError
from colibri.flights.children import end_children, events_of, start_child
from colibri.flights.plan import FlightPlan, Summary

_TOLD = ("ground", "heard", "said")
"""Events of the autopilot that a user who has invited ground stations wants to read."""


class FlightError(InFlightError):
    """A process ended before its flight did.

    Attributes:
        code: What the exit code shall be.
        said: Whether the process already told the user why.
    """

    def __init__(self, message: str, code: int, *, said: bool) -> None:
        """Fail with `message`."""
        super().__init__(message)
        self.code = code
        self.said = said


def fly_processes(
    plan: FlightPlan, progress: Callable[[float], None], say: Callable[[str], None] = lambda _: None
) -> Summary:
    """Fly `plan` as two processes on a free port. Both are gone when this returns or raises.

    Args:
        plan: What to fly.
        progress: Is told the simulated time in s.
        say: Is told in words where ground stations may connect, and which have.

    Raises:
        FlightError: One of them ended before the flight did.
    """
    processes: dict[str, subprocess.Popen[bytes]] = {}
    try:
        processes["plant"] = start_child("plant", *_plant_options(plan), stdout=subprocess.PIPE)
        for name, event in events_of(processes, lambda: _check_alive(processes)):
            if name == "autopilot":
                if event["event"] in _TOLD:
                    say(event["text"])
            elif event["event"] == "listening":
                url = event["url"].replace("udpin", "udpout")
                said = subprocess.PIPE if plan.ground.links else subprocess.DEVNULL
                processes["autopilot"] = start_child(
                    "autopilot", "--plant", url, *_autopilot_options(plan), stdout=said
                )
            elif event["event"] == "progress":
                progress(event["sim_time_s"])
            elif event["event"] == "ended":
                return Summary(event["wall_time_s"], event["frames"], event["resent"])
        _check_alive(processes)
        raise FlightError("a process ended before the flight did", 1, said=False)
    finally:
        end_children(list(processes.values()))


def _plant_options(plan: FlightPlan) -> list[str]:
    return [
        *("--link", "udpin:127.0.0.1:0"),
        *("--vehicle", plan.plant_vehicle_name),
        *("--integrator", plan.integrator),
        *(f"--without={part}" for part in plan.without),
        *plan.weather.options(),
        *("--start", str(plan.start)),
        *("--seed", str(plan.seed)),
        *("--latency", repr(plan.latency_us / 1e3)),
        *("--duration", repr(plan.duration_s)),
        *("--speed", repr(plan.speed) if isfinite(plan.speed) else "max"),
        *("--out", str(plan.out)),
    ]


def _autopilot_options(plan: FlightPlan) -> list[str]:
    return [
        *("--track", plan.track_name),
        *("--profile", plan.profile_name),
        *("--vehicle", plan.vehicle_name),
        *("--controller", plan.profile.controller),
        *("--feedback", plan.feedback),
        *(("--solver", plan.solver) if plan.solver else ()),
        *(f"--gcs={url}" for url in plan.ground.links),
        *(("--signing-key", str(plan.ground.signing_key)) if plan.ground.signing_key else ()),
        *(("--insecure",) if plan.ground.insecure else ()),
        *("--out", str(plan.out)),
    ]


def _check_alive(processes: dict[str, subprocess.Popen[bytes]]) -> None:
    for name, process in processes.items():
        code = process.poll()
        if code is None or code == 0:
            continue
        if code < 0:
            raise FlightError(f"the {name} was killed by {signal.Signals(-code).name}", 1, said=False)
        raise FlightError(f"the {name} ended with exit code {code}", code, said=True)
