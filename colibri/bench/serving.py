"""Cost of ground stations after a frame, and beside a control step."""

import socket
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any
from unittest.mock import patch

from colibri.analysis.recording import read_recording
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.copter import copter_autopilot
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import StationSettings
from colibri.bench.speed import TRACK, Report, plan_of, sampled
from colibri.bench.stages import Figures, summary
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.process.lifecycle import gc_frozen
from colibri.flights.flight import Direct, SteppedFlight
from colibri.flights.fly import fly_processes
from colibri.flights.plan import FlightPlan
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.streaming.rates import GCS, SDK
from colibri.plant.process.start import nudged
from colibri.plant.simulation.plant import PlantBuilder

CHANNELS = (0, 1, 2, 4, 8)
"""Alternately a ground station's and an SDK's."""
KINDS = (GCS, SDK)
STATIONS = 2
ALONE, WATCHED = "alone", f"{STATIONS} stations"
_WATCHING = {ALONE: 0, WATCHED: STATIONS}

_MIN_FRAMES = 4
"""Frames until all code is loaded."""


def serving_figures(profile: Profile, folder: Path, duration_s: float, runs: int, report: Report) -> dict[str, Any]:
    plan = plan_of(profile, folder, duration_s, "udp")
    serve: dict[str, Figures] = {}
    for channels in CHANNELS:
        report(f"serving {channels} ground stations")
        serve[str(channels)] = served(plan, channels)
    measures = {name: partial(control_steps_us, plan, stations) for name, stations in _WATCHING.items()}
    steps = sampled(runs, lambda name: report(f"control steps, {name}"), measures)
    middle = {
        name: {key: sorted(figures[key] for figures in flown)[runs // 2] for key in flown[0]}
        for name, flown in steps.items()
    }
    return {"track": TRACK, "serve": serve, "control_step_us": middle}


def served(plan: FlightPlan, channels: int) -> Figures:
    """Fly in memory; return the time to serve the channels, with the log, after a frame, µs."""
    settings = StationSettings(system_id=1, identity="px4", origin=DEFAULT_ORIGIN)
    autopilot = copter_autopilot(plan.profile, plan.vehicle, settings, perf_counter, first=plan.track)
    stations = autopilot.stages.stations
    for link in range(channels):
        stations.use(stations.hub.open(link, ("127.0.0.1", link)), KINDS[link % len(KINDS)])
    plant = PlantBuilder(plan.spec, plan.plant_vehicle, {plan.spec.feedback: nudged(plan.start)}).build(
        plan.spec.feedback, autopilot.frame_interval_us
    )
    times_us: list[float] = []
    serve = autopilot.serve

    def timed(inbox: Iterable[Received] = ()) -> list[Outgoing]:
        began_s = perf_counter()
        outbox = serve(inbox)
        times_us.append((perf_counter() - began_s) * 1e6)
        return outbox

    with gc_frozen(), patch.object(autopilot, "serve", timed):
        for _ in SteppedFlight(plant, autopilot, Direct()).samples(plan.spec.duration):
            pass
    sent = sum(channel.sent for channel in stations.hub.channels if channel.link >= 0)
    return {**summary(times_us[_MIN_FRAMES:]), "messages_hz": sent / plan.spec.duration}


def control_steps_us(plan: FlightPlan, stations: int) -> Figures:
    """Fly at real time beside ground stations."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(stations)]
        for sock in sockets:  # takes datagrams, and ignores them
            sock.bind(("127.0.0.1", 0))
        links = tuple(f"udpout:127.0.0.1:{sock.getsockname()[1]}" for sock in sockets)
        watched = replace(plan, spec=replace(plan.spec, speed=1.0, gcs=links))
        fly_processes(watched)
        return summary(read_recording(watched).control_step_us[1:].tolist())
