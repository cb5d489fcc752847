"""What sensors cost: a step of the estimator, and a flight on them beside one on the state."""

from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.estimation.estimator import Estimator
from colibri.bench.speed import Report, Samples, real_time_factor, summarised
from colibri.bench.stages import summary
from colibri.bench.variants import plan_of
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.flights.fly import fly_plan
from colibri.flights.in_process import SYSTEM_ID
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import OWN_MESSAGES, SensorFrame, decode_sensors
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec, Message
from colibri.mavlink.wire.tlog import decode
from colibri.plant.vehicle.description import load_vehicle

TRACK = "spiral"
FRAME_US, CONTROL_US = 4_000, 8_000
LINKS = ("memory", "udp")
ALWAYS, IN_FLIGHT = "asked at every frame", "asked at every control sample"
_MIN_S = 4.0
"""A flight on sensors begins with a second of standing; the estimator then is still loading what it needs."""
_SETTLED = 500
"""Frames that are not counted: the estimator aligns itself, and meets everything for the first time."""
FLIGHTS_A_RUN = len(LINKS) * len(Feedback)


def sensing_figures(profile: Profile, folder: Path, duration_s: float, runs: int, report: Report) -> dict[str, Any]:
    """Time the estimator on the frames of a flight; fly on sensors and on the state, in turn, in every run."""
    duration_s = max(duration_s, _MIN_S)
    report("estimator")
    fly_plan(plan_of(profile, folder, duration_s, "memory", Feedback.SENSORS))
    frames = list(sensor_frames((folder / "flight.tlog").read_bytes()))
    steps = {
        ALWAYS: summary(_timed(profile, frames, lambda _time_us: True)),
        IN_FLIGHT: summary(_timed(profile, frames, lambda time_us: time_us % CONTROL_US == 0)),
    }
    samples: Samples = {}
    for run in range(runs):
        for link in LINKS:
            for feedback in Feedback:
                name = f"{link}, {feedback}"
                report(f"{name}, {run + 1} of {runs}")
                factor = real_time_factor(plan_of(profile, folder, duration_s, link, feedback))
                samples.setdefault(name, []).append(factor)
    return {
        "track": TRACK,
        "estimator_us": steps,
        "real_time_factor": {name: summarised(values) for name, values in samples.items()},
    }


def sensor_frames(tlog: bytes) -> Iterator[SensorFrame]:
    """Read the sensors' frames of a telemetry log, in order."""
    codec = Codec(SYSTEM_ID, dialect.AUTOPILOT_COMPONENT)
    parts: list[Message] = []
    own = {row.message for row in OWN_MESSAGES}
    for _, frame in decode(tlog):
        for message in codec.decode(frame):
            if message.name == "HIL_SENSOR":
                if parts:
                    yield decode_sensors(*parts)
                parts = [message]
            elif message.name in own and parts:
                parts.append(message)
    if parts:
        yield decode_sensors(*parts)


def _timed(profile: Profile, frames: list[SensorFrame], asked: Callable[[int], bool]) -> list[float]:
    """Return how long the estimator takes for each frame, µs."""
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
