"""Checks in flight: hover, the thesis's tracks, wind; and the time of a step."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.outcome import fly_to_its_end
from colibri.analysis.recording import read_recording
from colibri.autopilot.control.registry import in_words
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.conformance.step_records import fly_for_steps
from colibri.conformance.subject import Result, Row, Subject, judged, not_applicable

_HOVER_S, _MAX_DRIFT_M = 8.0, 0.5
"""Permitted drift in calm air, from rest on the point."""
_WIND, _WIND_S = "5@270", 12.0
_TIMED_S, _TIMED, _UNTIMED = 4.0, 200, 5
"""Duration and least number of timed steps; the first few are left out."""


class FlownDistance(NamedTuple):
    """Distance to the reference at each control sample, m, and reason of a loss."""

    lost: str
    off_m: Any

    @property
    def rms_m(self) -> float:
        """RMS over the last third."""
        late = self.off_m[2 * len(self.off_m) // 3 :]
        return float(np.sqrt(np.mean(late**2))) if len(late) else np.nan


def flight_checks(subject: Subject) -> Iterator[Row]:
    yield _hover(subject)
    for track in THESIS_TRACKS:
        yield _flown(subject, track, f"{track}, {subject.duration_s:g} s", duration=subject.duration_s)
    if subject.vehicle.drag is None:
        yield not_applicable("hover in wind of 5 m/s", f"{subject.vehicle.name} has no drag")
    else:
        yield _flown(
            subject,
            "hover",
            "hover in wind of 5 m/s, turbulence",
            wind=_WIND,
            turbulence="light",
            start=subject.start(),
            duration=_WIND_S,
        )


def time_checks(subject: Subject) -> Iterator[Row]:
    """Yield times of steps: figures, as they vary between runs."""
    interval_us = subject.build().control_interval_us
    seconds = max(_TIMED_S, _TIMED * interval_us * 1e-6)
    steps = fly_for_steps(subject, "lemniscate:lap=20", duration=seconds).steps[_UNTIMED:]
    if not steps:
        yield not_applicable("a step", "it took too few")
        return
    p50_us, p99_us = np.percentile([1e6 * step.took_s for step in steps], (50, 99))
    part = p99_us / interval_us
    found = f"p50 {p50_us:.0f} µs, p99 {p99_us:.0f} µs: {part:.2g} of its {interval_us / 1000:g} ms"
    yield Row("", f"{len(steps)} steps", Result.FIGURE, found)


def _hover(subject: Subject) -> Row:
    options = {"start": subject.start(), "duration": _HOVER_S}
    flown = fly(subject, "hover", **options)
    furthest_m = float(flown.off_m.max()) if len(flown.off_m) else np.nan
    drifts = f"{furthest_m:.2f} m off its point: expected at most {_MAX_DRIFT_M:g} m"
    failure = flown.lost or (drifts if not furthest_m <= _MAX_DRIFT_M else "")
    found = f"at most {_length(furthest_m)} off"
    return judged(f"hover held, {_HOVER_S:g} s", failure, found, subject.command("hover", **options))


def _flown(subject: Subject, track: str, tried: str, **options: Any) -> Row:
    flown = fly(subject, track, **options)
    found = f"RMS {_length(flown.rms_m)} after {options['duration'] * 2.0 / 3.0:.3g} s"
    return judged(tried, flown.lost, found, subject.command(track, **options))


def fly(subject: Subject, track: str, **options: Any) -> FlownDistance:
    try:
        plan = subject.plan(track, **options)
        outcome = fly_to_its_end(plan)
    except Exception as error:
        return FlownDistance(in_words(error), np.empty(0))
    if outcome.report is None:
        return FlownDistance(outcome.lost, np.empty(0))
    return FlownDistance(outcome.lost, read_recording(plan, outcome.log).position_error_m)


def _length(metres: float) -> str:
    return f"{1000.0 * metres:.3g} mm" if metres < 1.0 else f"{metres:.3g} m"
