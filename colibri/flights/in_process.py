"""A flight within this process: through the codec but without sockets (`memory`), or without either (`direct`)."""

from collections.abc import Callable
from math import isfinite
from time import perf_counter, sleep
from typing import Any, Protocol

from colibri.autopilot.control.interface import Clock
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.step import Step, answer
from colibri.autopilot.core.track_stages import TrackStages, track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.process.logs import AutopilotLog, log_in
from colibri.autopilot.process.run import setup_of
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.process.lifecycle import gc_frozen, loading
from colibri.common.types import Address
from colibri.flights.plan import FlightPlan, Summary, unseen
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.ulog.log import TopicLog
from colibri.mavlink.wire.tlog import TlogWriter
from colibri.plant.process.logs import TRAFFIC, TruthLog
from colibri.plant.process.start import nudged
from colibri.plant.simulation.plant import Plant, PlantBuilder

SYSTEM_ID = 1
_ADDRESS: Address = ("memory", 0)
_NEVER_LATE_S = 0.0


class Exchange(Protocol):
    """How a frame of the plant gets to the autopilot, and its command back."""

    def __call__(self, plant: Plant) -> tuple[Step, ActuatorCommand, bytes | None]:
        """Return the autopilot's step, the command that reached the plant, and the frame's datagram if there is one."""


def fly_locally(
    plan: FlightPlan, progress: Callable[[float], None] = unseen, topics: TopicLog | None = None
) -> Summary:
    """Fly `plan` in this process, and record it in `topics`, or else in the plan's folder.

    `progress` is called with the simulated time, s.

    Raises:
        ControllerError: The control law cannot be used.
        DecisionError: The control law decided what no rotor can follow.
        ProfileError: The control law's table in the profile is wrong.
        SolverError: The solver cannot be used.
        IntegrationError: The state cannot be integrated any further.
    """
    with loading():
        autopilot, plant = put_together(plan, perf_counter)
    interval_us = plant.interval_us
    setup = setup_of(plan.autopilot_spec(""), plan.profile, plan.vehicle, plan.contents.track_file)
    log = log_in(plan.out, setup) if topics is None else AutopilotLog(topics, setup)
    truth = TruthLog(log.topics, plan.plant_vehicle)
    traffic = TlogWriter(plan.out / TRAFFIC) if plan.spec.tlog and topics is None else None
    exchange: Exchange = Direct(autopilot)
    if plan.spec.link == "memory":
        exchange = InMemory(autopilot, interval_us, plan.spec.feedback, traffic)
    end_us, is_paced = plan.spec.duration * 1e6, isfinite(plan.spec.pace)
    try:
        truth.write_world(plant.world)
        with gc_frozen():
            began_s = perf_counter()
            while plant.world.time_us + interval_us <= end_us:
                if is_paced:
                    sleep(max(0.0, began_s + plant.world.time_us / 1e6 / plan.spec.pace - perf_counter()))
                step, command, datagram = exchange(plant)
                plant.answer(command)
                log.write(step, datagram)
                truth.write_world(plant.world)
                progress(plant.world.time_us / 1e6)
            log.flush()
            wall_time_s = perf_counter() - began_s
    finally:
        log.close()
        if traffic:
            traffic.close()
    return Summary(wall_time_s, frames=plant.world.time_us // interval_us, resent=0)


def put_together(plan: FlightPlan, clock: Clock) -> tuple[Autopilot[TrackStages], Plant]:
    """Return the autopilot and the plant of a flight as it begins; `clock` only measures.

    Raises:
        ControllerError, ProfileError, SolverError: As `fly_locally`.
    """
    estimator = estimator_for(plan.spec.feedback, plan.vehicle, DEFAULT_ORIGIN)
    autopilot = track_autopilot(plan.profile, plan.vehicle, plan.track, clock, estimator=estimator, law=plan.spec.law)
    starts = {plan.spec.feedback: nudged(plan.start)}
    builder = PlantBuilder(plan.spec, plan.plant_vehicle, starts, integrator=plan.integrator)
    return autopilot, builder.build(plan.spec.feedback, autopilot.frame_interval_us)


class Direct:
    """Hands frame and command over in double precision, without the codec."""

    def __init__(self, autopilot: Autopilot[Any]) -> None:
        """Ask `autopilot`."""
        self._autopilot = autopilot

    def __call__(self, plant: Plant) -> tuple[Step, ActuatorCommand, bytes | None]:
        """Return the autopilot's step and its command as it is."""
        step = self._autopilot.step(*plant.measure())
        return step, step.command, None


class InMemory:
    """Carries the datagrams that the two processes would send, in the same conversation."""

    def __init__(
        self, autopilot: Autopilot[Any], frame_interval_us: int, feedback: Feedback, traffic: TlogWriter | None
    ) -> None:
        """Let `autopilot` call the plant and request `feedback`."""
        self._autopilot = autopilot
        self._traffic = traffic
        self._plant_end = PlantEnd(system_id=SYSTEM_ID, frame_interval_us=frame_interval_us, serves=[feedback])
        self._autopilot_end = AutopilotEnd(
            system_id=SYSTEM_ID, frame_interval_us=frame_interval_us, now_s=_NEVER_LATE_S, feedback=feedback
        )
        self._autopilot_end.poll(_NEVER_LATE_S)
        self._to_plant(time_us=0)

    def __call__(self, plant: Plant) -> tuple[Step, ActuatorCommand, bytes | None]:
        """Return the autopilot's step, the command as the plant decoded it, and the frame's datagram."""
        with_battery = self._plant_end.sends_battery(plant.world.time_us)
        frame, plant_status = plant.measure(with_battery=with_battery)
        self._plant_end.offer(frame, _NEVER_LATE_S, plant_status)
        step, datagram = self._to_autopilot(frame.time_us)
        command = self._to_plant(frame.time_us)
        assert step is not None, "the autopilot answers every new frame"
        assert command is not None, "the answer names the frame awaited"
        return step, command, datagram

    def _to_autopilot(self, time_us: int) -> tuple[Step | None, bytes]:
        step, datagram = None, b""
        for outgoing in self._plant_end.take_outbox():
            if self._traffic:
                self._traffic.write(time_us, list(outgoing.frames))
            datagram = outgoing.datagram
            step = answer(self._autopilot_end, self._autopilot, datagram, _NEVER_LATE_S) or step
        return step, datagram

    def _to_plant(self, time_us: int) -> ActuatorCommand | None:
        command = None
        for datagram in self._autopilot_end.take_outbox():
            command = self._plant_end.receive(datagram, _ADDRESS, _NEVER_LATE_S) or command
        if self._traffic:
            self._traffic.write(time_us, list(self._plant_end.received))
        self._plant_end.received.clear()
        return command
