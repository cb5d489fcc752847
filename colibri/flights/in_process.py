"""A flight in this process, over link `memory` or `direct`."""

from collections.abc import Callable
from math import isfinite
from time import perf_counter, sleep

from colibri.autopilot.control.interface import Clock
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.track_stages import TrackStages, track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.process.logs import AutopilotLog, log_in
from colibri.autopilot.process.recorded_inputs import setup_of
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.process.lifecycle import gc_frozen, loading
from colibri.flights.flight import Direct, InMemory, SteppedFlight, Wire
from colibri.flights.plan import FlightPlan, FrameCount, unseen
from colibri.mavlink.ulog.log import TopicLog
from colibri.mavlink.wire.tlog import TRAFFIC, TlogWriter
from colibri.plant.physics.start import nudged
from colibri.plant.process.reports import TruthLog
from colibri.plant.simulation.plant import Plant, PlantBuilder


def fly_locally(
    plan: FlightPlan, progress: Callable[[float], None] = unseen, topics: TopicLog | None = None
) -> FrameCount:
    """Record in `topics`, or else in the plan's folder."""
    with loading():
        autopilot, plant = put_together(plan, perf_counter)
    autopilot.stages.loop.hide_plan()
    setup = setup_of(plan.autopilot_spec(""), plan.profile, plan.vehicle, plan.contents.track_file)
    log = log_in(plan.out, setup) if topics is None else AutopilotLog(topics, setup)
    truth = TruthLog(log.topics, plan.plant_vehicle)
    traffic = TlogWriter(plan.out / TRAFFIC) if plan.spec.tlog and topics is None else None
    wire: Wire = Direct()
    if plan.spec.link == "memory":
        record = traffic.write if traffic else None
        replayed, rotors = log.topics.for_viewers, plan.plant_vehicle.rotors.count
        wire = InMemory(plant.interval_us, plan.spec.feedback, traffic=record, replayed=replayed, rotors=rotors)
    frames, pace = 0, plan.spec.pace
    is_paced = isfinite(pace)
    try:
        truth.write_world(plant.world)
        with gc_frozen():
            began_s = perf_counter()
            for sample in SteppedFlight(plant, autopilot, wire).samples(plan.spec.duration):
                now_us, next_us = sample.command.time_us, sample.world.time_us
                log.write(sample.step, sample.datagram, range(now_us + plant.interval_us, next_us, plant.interval_us))
                truth.write(sample.flown, next_us)
                frames += len(sample.flown)
                time_s = next_us / 1e6
                progress(time_s)
                if is_paced:
                    sleep(max(0.0, began_s + time_s / pace - perf_counter()))
            log.flush()
            wall_time_s = perf_counter() - began_s
    finally:
        log.close()
        if traffic:
            traffic.close()
    return FrameCount(wall_time_s, frames=frames, resent=0)


def put_together(plan: FlightPlan, clock: Clock) -> tuple[Autopilot[TrackStages], Plant]:
    """Build autopilot and plant; `clock` only measures."""
    estimator = estimator_for(plan.spec.feedback, plan.vehicle, DEFAULT_ORIGIN)
    autopilot = track_autopilot(plan.profile, plan.vehicle, plan.track, clock, estimator=estimator, law=plan.spec.law)
    return autopilot, plant_of(plan, autopilot.frame_interval_us)


def plant_of(plan: FlightPlan, interval_us: int) -> Plant:
    starts = {plan.spec.feedback: nudged(plan.start)}
    builder = PlantBuilder(plan.spec, plan.plant_vehicle, starts, integrator=plan.integrator)
    return builder.build(plan.spec.feedback, interval_us)
