"""Cost of sensors: estimator steps, and flights with and without."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.estimation.estimator import Estimator
from colibri.bench.speed import TRACK, Report, plan_of, real_time_factor, sampled, summarised
from colibri.bench.stages import summary
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.flights.flight import SYSTEM_ID
from colibri.flights.fly import fly_plan
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.ulog.inputs import InputRecord, RecordKind
from colibri.mavlink.ulog.reader import FILE, FlightFile
from colibri.plant.vehicle.description import load_vehicle

FRAME_US, CONTROL_US = 4_000, 8_000
LINKS = ("memory", "udp")
ALWAYS, IN_FLIGHT = "asked at every frame", "asked at every control sample"
_MIN_S = 4.0
"""It begins with a second of standing."""
_SETTLED = 500
"""Frames left out: the estimator aligns."""
FLIGHTS_A_RUN = len(LINKS) * len(Feedback)


def sensing_figures(profile: Profile, folder: Path, duration_s: float, runs: int, report: Report) -> dict[str, Any]:
    duration_s = max(duration_s, _MIN_S)
    report("estimator")
    fly_plan(plan_of(profile, folder, duration_s, "memory", Feedback.SENSORS))
    frames = list(sensor_frames(FlightFile(folder / FILE).inputs()))
    steps = {
        ALWAYS: summary(_timed(profile, frames, lambda _time_us: True)),
        IN_FLIGHT: summary(_timed(profile, frames, lambda time_us: time_us % CONTROL_US == 0)),
    }
    plans = {
        f"{link}, {feedback}": plan_of(profile, folder, duration_s, link, feedback)
        for link in LINKS
        for feedback in Feedback
    }
    samples = sampled(runs, report, {name: partial(real_time_factor, plan) for name, plan in plans.items()})
    return {
        "track": TRACK,
        "estimator_us": steps,
        "real_time_factor": {name: summarised(values) for name, values in samples.items()},
    }


def sensor_frames(inputs: Iterable[InputRecord]) -> Iterator[SensorFrame]:
    end = AutopilotEnd(system_id=SYSTEM_ID, frame_interval_us=FRAME_US, now_s=0.0, feedback=Feedback.SENSORS)
    for _, kind, datagram in inputs:
        received = end.receive(datagram, 0.0) if kind == RecordKind.FRAME else None
        if received is not None and isinstance(received.frame, SensorFrame):
            yield received.frame


def _timed(profile: Profile, frames: list[SensorFrame], asked: Callable[[int], bool]) -> list[float]:
    vehicle = load_vehicle(profile.simulation.vehicle)
    assert vehicle.sensors is not None, "the profile's vehicle has sensors"
    estimator = Estimator(vehicle.sensors, vehicle.gravity_m_s2, DEFAULT_ORIGIN, FRAME_US)
    times_us = []
    for frame in frames:
        wanted = asked(frame.time_us)
        began_s = perf_counter()
        estimator.receive(frame)
        estimator.estimate() if wanted else estimator.advance()
        times_us.append((perf_counter() - began_s) * 1e6)
    return times_us[_SETTLED:]
