"""Variants of profile `flight`, and real-time factors."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, TypeAlias, TypeVar

from colibri.autopilot.control.profile import Profile
from colibri.flights.fly import fly_plan
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback

CONTROLLER = "lpv-mpc"
TRACK = "lemniscate"


def with_blocks(profile: Profile, blocks: Sequence[int]) -> Profile:
    return profile.replace(f"controllers.{CONTROLLER}.plan.blocks", list(blocks))


def with_intervals(profile: Profile, *, frame_s: float, control_s: float) -> Profile:
    free = profile.replace("simulation.frame_interval_s", None)  # which must divide the control interval
    changed = free.replace(f"controllers.{CONTROLLER}.control_interval_s", control_s)
    return changed.replace("simulation.frame_interval_s", frame_s)


def plan_of(
    profile: Profile, folder: Path, duration_s: float, link: str, feedback: Feedback = Feedback.STATE
) -> FlightPlan:
    options = {"profile": profile, "link": link, "feedback": feedback, "duration": duration_s, "out": folder}
    return FlightPlan.of(FlightSpec.of(TRACK, **options))


Report: TypeAlias = Callable[[str], None]
T = TypeVar("T")
Samples: TypeAlias = dict[str, list[float]]

CONTROL_S: Mapping[int, float] = {100: 0.01, 250: 0.008, 500: 0.008}
"""Control interval at each frame rate, Hz."""
LINKS = ("memory", "udp")

_PEER_MAX_S = 2.0
"""A peer may be slower than real time."""
_WARM_UP_S = 0.5


class PeerSimulator(NamedTuple):
    """Another simulator: from frame rate, Hz, and duration, s, to real-time factor."""

    name: str
    real_time_factor: Callable[[int, float], float]


def rate_figures(
    profile: Profile, folder: Path, duration_s: float, runs: int, report: Report, peer: PeerSimulator | None = None
) -> dict[str, Any]:
    """Fly at every rate over every link; ratios are within a run."""
    report("warm up")
    plan = plan_of(profile, folder, _WARM_UP_S, "memory")
    fly_plan(plan)
    measures: dict[str, Callable[[], float]] = {}
    for frames_hz, control_s in CONTROL_S.items():
        chosen = with_intervals(profile, frame_s=1.0 / frames_hz, control_s=control_s)
        for link in LINKS:
            plan = plan_of(chosen, folder, duration_s, link)
            measures[f"{frames_hz} Hz, {link}"] = partial(real_time_factor, plan)
        if peer is not None:
            factor = partial(peer.real_time_factor, frames_hz, min(duration_s, _PEER_MAX_S))
            measures[f"{frames_hz} Hz, {peer.name}"] = factor
    samples = sampled(runs, report, measures)
    names = (*LINKS, peer.name) if peer else LINKS
    rates = {str(hz): _with_ratios({name: samples[f"{hz} Hz, {name}"] for name in names}, peer) for hz in CONTROL_S}
    return {"track": TRACK, "control_interval_s": {str(hz): s for hz, s in CONTROL_S.items()}, "rates_hz": rates}


def sampled(runs: int, report: Report, measures: Mapping[str, Callable[[], T]]) -> dict[str, list[T]]:
    """Take measures in turn, run after run: other load weighs on all."""
    samples: dict[str, list[T]] = {name: [] for name in measures}
    for run in range(runs):
        for name, measure in measures.items():
            report(f"{name}, {run + 1} of {runs}")
            samples[name].append(measure())
    return samples


def summarised(values: Iterable[float]) -> dict[str, float]:
    ordered = sorted(values)
    return {"min": ordered[0], "median": median(ordered), "max": ordered[-1]}


def _with_ratios(flown: Samples, peer: PeerSimulator | None) -> dict[str, dict[str, float]]:
    figures = {name: summarised(values) for name, values in flown.items()}
    if peer is None:
        return figures
    for link in LINKS:
        pairs = zip(flown[link], flown[peer.name], strict=True)
        figures[f"{link} / {peer.name}"] = summarised(ours / theirs for ours, theirs in pairs)
    return figures


def real_time_factor(plan: FlightPlan) -> float:
    return plan.spec.duration / fly_plan(plan).wall_time_s
