"""Time of each stage of a control step, in flight."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from dataclasses import replace
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.control.lpv_mpc import planning
from colibri.autopilot.control.lpv_mpc.mpc import Mpc, Qps
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.qp import Qp, QpSolver, QpStatus, installed_solvers
from colibri.autopilot.control.vehicle_model import rotor_lag
from colibri.autopilot.core.autopilot import Autopilot
from colibri.bench.speed import CONTROLLER, TRACK, plan_of, with_blocks
from colibri.flights.in_process import fly_locally
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.links.open import open_link

Figures: TypeAlias = dict[str, float]

BLOCKS: Mapping[int, tuple[int, ...]] = {12: (1, 2, 3, 6), 28: (1, 2, 3, 5, 7, 10), 60: (1, 2, 4, 8, 15, 30)}
"""Steps of each correction, by horizon: short, as in `flight`, and as in `path`."""
PROFILE_HORIZON = 28

_QPS = 100  # QPs of a flight for each solver
_QPS_TO_WARM_UP = 5
_MIN_SAMPLES = 50
_REPLY_WITHIN_S = 1.0
_ECHO_ENDS_AFTER_S = 10.0


class Stage(NamedTuple):
    name: str
    owner: type | ModuleType
    method: str


CONTROL_STEP = Stage("control step", Autopilot, "step")
STAGES = (
    Stage("observe, references, condense", planning, "begin_by_clock"),
    Stage("QP and plan", Mpc, "plan"),
    Stage("mixer", rotor_lag, "actuate"),
    CONTROL_STEP,
)
FRAME_SENT = Stage("encode frame", PlantEnd, "offer")
FRAME_RECEIVED = Stage("decode frame", AutopilotEnd, "receive")
COMMAND_SENT = Stage("encode command", AutopilotEnd, "answer")
COMMAND_RECEIVED = Stage("decode command", PlantEnd, "receive")
LINK_STAGES = (FRAME_SENT, FRAME_RECEIVED, COMMAND_SENT, COMMAND_RECEIVED)
EXCHANGE = "exchange"


class StageTimes(NamedTuple):
    times_us: dict[str, list[float]]
    qps: list[Qp]
    frames: list[bytes]
    commands: list[bytes]


def measured_flight(profile: Profile, folder: Path, duration_s: float) -> StageTimes:
    """Fly in memory, timing every stage once all code is loaded."""
    flight = StageTimes({stage.name: [] for stage in (*STAGES, *LINK_STAGES)}, [], [], [])
    every = max(1, round(duration_s / float(profile.table(CONTROLLER)["control_interval_s"]) / _QPS))
    seen, flying = 0, False

    def keep_qp(_result: Any, qps: Qps, *_: Any) -> None:
        nonlocal seen
        if seen % every == 0:
            flight.qps.append(deepcopy(qps.free))
        seen += 1

    def begun(_sim_time_s: float) -> None:
        nonlocal flying
        flying = True

    keepers: dict[str, Callable[..., object]] = {
        "QP and plan": keep_qp,
        FRAME_RECEIVED.name: lambda _result, datagram, *_: flight.frames.append(datagram),
        COMMAND_RECEIVED.name: lambda _result, datagram, *_: flight.commands.append(datagram),
    }
    plan = plan_of(profile, folder, duration_s, "memory")
    plan = replace(plan, spec=replace(plan.spec, tlog=True))  # else frames are rounded, not encoded
    with ExitStack() as stack:
        for stage in (*STAGES, *LINK_STAGES):
            keeper = keepers.get(stage.name, lambda *_: None)
            stack.enter_context(timed(stage, flight.times_us[stage.name], keeper, lambda: flying))
        fly_locally(plan, begun)
    return flight


def summary(times_us: Sequence[float]) -> Figures:
    p50, p99 = np.percentile(times_us, (50, 99))
    return {"p50": float(p50), "p99": float(p99), "samples": len(times_us)}


def stage_figures(profile: Profile, folder: Path, duration_s: float, report: Callable[[str], None]) -> dict[str, Any]:
    horizons: dict[str, Any] = {}
    solvers: dict[str, dict[str, Figures]] = {}
    link: dict[str, Figures] = {}
    for horizon, blocks in BLOCKS.items():
        chosen = with_blocks(profile, blocks)
        report(f"stages, N = {horizon}")
        measured_flight(chosen, folder, min(duration_s, 0.5))
        flight = measured_flight(chosen, folder, duration_s)
        us = {stage.name: summary(flight.times_us[stage.name]) for stage in STAGES}
        horizons[str(horizon)] = {"blocks": list(blocks), "us": us}
        solvers[str(horizon)] = {}
        for solver in installed_solvers():
            report(f"QP by {solver}, N = {horizon}")
            solvers[str(horizon)][solver] = solver_figures(chosen, solver, flight.qps)
        if horizon == PROFILE_HORIZON:
            report("datagrams")
            link = {stage.name: summary(flight.times_us[stage.name]) for stage in LINK_STAGES}
            link[EXCHANGE] = summary(exchange_times_us(flight.frames, flight.commands))
    return {"track": TRACK, "horizons": horizons, "solvers": solvers, "link": link}


def solver_figures(profile: Profile, name: str, qps: Sequence[Qp]) -> Figures:
    settings = profile.table(CONTROLLER)["qp"]
    solver = QpSolver(name, settings["tolerance"], settings["max_iterations"])
    for qp in qps[:_QPS_TO_WARM_UP]:
        solver.solve(qp)
    times_us, solved = [], 0
    for qp in qps:
        began_s = perf_counter()
        status = solver.solve(qp).status
        times_us.append((perf_counter() - began_s) * 1e6)
        solved += status is QpStatus.SOLVED
    return {**summary(times_us), "solved": solved / len(qps)}


def exchange_times_us(frames: Sequence[bytes], commands: Sequence[bytes]) -> list[float]:
    """Exchange frames for commands with another process; return round trips, µs."""
    here, there = Pipe()
    answering = get_context("spawn").Process(target=_answer_datagrams, args=(there, list(commands)), daemon=True)
    answering.start()
    try:
        link = open_link(here.recv())
        times_us: list[float] = []
        for frame in (*frames[:_MIN_SAMPLES], *frames):
            began_s = perf_counter()
            link.send(frame)
            if link.receive(_REPLY_WITHIN_S) is not None:
                times_us.append((perf_counter() - began_s) * 1e6)
        link.close()
    finally:
        answering.terminate()
        answering.join()
        here.close()
    return times_us[_MIN_SAMPLES:]


def _answer_datagrams(pipe: Connection, answers: Sequence[bytes]) -> None:
    link = open_link("udpin:127.0.0.1:0")
    pipe.send(link.url.replace("udpin", "udpout"))
    count = 0
    while (received := link.receive(_ECHO_ENDS_AFTER_S)) is not None:
        link.send(answers[count % len(answers)], received[1])
        count += 1


@contextmanager
def timed(
    stage: Stage,
    times_us: list[float],
    keep: Callable[..., object] = lambda *_: None,
    flying: Callable[[], bool] = lambda: True,
) -> Iterator[None]:
    """Time a method within a block; `keep` gets its result and arguments, while `flying()`."""
    untimed = getattr(stage.owner, stage.method)

    def timing(self: Any, *args: Any, **kwargs: Any) -> Any:
        began_s = perf_counter()
        result = untimed(self, *args, **kwargs)
        took_s = perf_counter() - began_s
        if flying():
            keep(result, *args)
            if stage is not CONTROL_STEP or result.decision is not None:
                times_us.append(took_s * 1e6)
        return result

    setattr(stage.owner, stage.method, timing)
    try:
        yield
    finally:
        setattr(stage.owner, stage.method, untimed)
