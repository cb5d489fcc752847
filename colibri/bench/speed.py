"""Real-time factors at several frame rates, beside a peer if there is one."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, TypeAlias

from colibri.autopilot.control.profile import Profile
from colibri.bench.variants import TRACK, plan_of, with_intervals
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.flights.fly import fly_plan
from colibri.flights.plan import FlightPlan
from colibri.flights.processes import FlightError

Report: TypeAlias = Callable[[str], None]
Samples: TypeAlias = dict[str, list[float]]

CONTROL_S: Mapping[int, float] = {100: 0.01, 250: 0.008, 500: 0.008}
"""Control interval at each frame rate, Hz."""
LINKS = ("memory", "udp")

_PEER_MAX_S = 2.0
"""A peer may be slower than real time."""
_WARM_UP_S = 0.5


class Peer(NamedTuple):
    """Another simulator: from frame rate, Hz, and duration, s, to simulated over wall-clock time."""

    name: str
    real_time_factor: Callable[[int, float], float]


def rate_figures(
    profile: Profile, folder: Path, duration_s: float, runs: int, report: Report, peer: Peer | None = None
) -> dict[str, Any]:
    """Fly at every rate over every link, and the peer; ratios are within a run, under the same load."""
    report("warm up")
    plan = plan_of(profile, folder, _WARM_UP_S, "memory")
    fly_plan(plan)
    samples: dict[int, Samples] = {frames_hz: {} for frames_hz in CONTROL_S}
    for run in range(runs):
        for frames_hz, control_s in CONTROL_S.items():
            chosen = with_intervals(profile, frame_s=1.0 / frames_hz, control_s=control_s)
            flown = samples[frames_hz]
            for link in LINKS:
                report(f"{frames_hz} Hz, {link}, {run + 1} of {runs}")
                flown.setdefault(link, []).append(real_time_factor(plan_of(chosen, folder, duration_s, link)))
            if peer is not None:
                report(f"{frames_hz} Hz, {peer.name}, {run + 1} of {runs}")
                factor = peer.real_time_factor(frames_hz, min(duration_s, _PEER_MAX_S))
                flown.setdefault(peer.name, []).append(factor)
    rates = {str(frames_hz): _with_ratios(flown, peer) for frames_hz, flown in samples.items()}
    return {"track": TRACK, "control_interval_s": {str(hz): s for hz, s in CONTROL_S.items()}, "rates_hz": rates}


def summarised(values: Iterable[float]) -> dict[str, float]:
    ordered = sorted(values)
    return {"min": ordered[0], "median": median(ordered), "max": ordered[-1]}


def _with_ratios(flown: Samples, peer: Peer | None) -> dict[str, dict[str, float]]:
    figures = {name: summarised(values) for name, values in flown.items()}
    if peer is None:
        return figures
    for link in LINKS:
        pairs = zip(flown[link], flown[peer.name], strict=True)
        figures[f"{link} / {peer.name}"] = summarised(ours / theirs for ours, theirs in pairs)
    return figures


def real_time_factor(plan: FlightPlan) -> float:
    try:
        return plan.spec.duration / fly_plan(plan).wall_time_s
    except FlightError as error:
        fail(str(error), EXIT_FAILED)
