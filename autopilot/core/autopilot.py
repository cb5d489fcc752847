"""The autopilot as a pure composition: frames of the plant and datagrams of ground stations in, answers out."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar, TypeVarTuple

from colibri.autopilot.control.delay import DelayCompensation
from colibri.autopilot.control.interface import Clock, Decision, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.core.defence.table import DELAY, STEP, nothing
from colibri.autopilot.core.step import Received, Step
from colibri.autopilot.estimation.state_source import StateSource
from colibri.autopilot.guidance.guidance import Guidance
from colibri.common.records import Record
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.plant_status import NOTHING, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ROTORS, ActuatorCommand, StateFrame
from colibri.mavlink.hil.world_changes import WorldChange

if TYPE_CHECKING:
    from colibri.mavlink.node.hub import Outgoing

_MISSED_US = 100_000  # frames may be missing so long: the model of the rotors still holds, more or less
T = TypeVar("T")
Ts = TypeVarTuple("Ts")


class ControlSample(Record, frozen=True):
    now_us: int  # time of its frame
    state: VehicleState
    guidance: Guidance
    decision: Decision | None  # None while the rotors stand or idle, or an earlier decision is being solved


class Stages(Protocol):
    """The stages of a frame, which differ between a vehicle on a track and one with ground stations."""

    loop: ControlLoop
    delay: DelayCompensation
    state_source: StateSource
    time_us: int | None  # of the last frame with a known state; None if the next one begins a flight
    repeats: bool  # whether frames between two control samples need no more than their time

    @property
    def mode(self) -> str: ...

    def guard(self, part: str, call: Callable[[*Ts], T], otherwise: Callable[[], T], /, *args: *Ts) -> T:
        """Return the result of `call`; after an exception raise, or return the result of `otherwise`."""

    def receive(self, frame: Frame, plant_status: PlantStatus, /) -> None: ...

    def estimate(self, frame: Frame, *, now: bool) -> StateFrame | None:
        """Return the state at a frame, or with `now` false at the frame before; None before the first estimate."""

    def wait(self, now_us: int, /) -> None: ...

    def enter(self, known: StateFrame, now_us: int, *, begins: bool) -> None:
        """Receive a frame with a known state; `begins`: of a new flight."""

    def ahead(self, known: StateFrame) -> StateFrame:
        """Predict the state at the time when a command sent now takes effect."""

    def supervise(self, now_us: int, state: VehicleState) -> None:
        """Execute the failsafe that is due at a control sample."""

    def guide(self, now_us: int, state: VehicleState, /) -> Guidance: ...

    def decide(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None: ...

    def rescue(self, known: StateFrame, now_us: int, /) -> Decision | None:
        """Return a decision after an exception in the sample."""

    def actuate(self, now_us: int) -> ActuatorCommand: ...

    def faults(self) -> tuple[Fault | WorldChange, ...]: ...

    def sampled(self, sample: ControlSample, duration_s: float) -> None:
        """Receive a completed control sample and its computation time."""

    def serve(self, inbox: Iterable[Received], /) -> "list[Outgoing]":
        """Do work without a deadline, and return the datagrams for ground stations."""


StagesT = TypeVar("StagesT", bound=Stages)


class Autopilot(Generic[StagesT]):
    """Flies one vehicle: estimate, observe, supervise, guide, decide, actuate."""

    def __init__(self, stages: StagesT, clock: Clock) -> None:
        self.stages = stages
        self.frame_interval_us = stages.loop.frame_interval_us  # the control interval or a fraction of it
        self._longest_us = max(self.frame_interval_us, _MISSED_US)
        self._clock = clock

    def step(self, frame: Frame, plant_status: PlantStatus = NOTHING) -> Step:
        """Answer a frame; after a long gap, or a step back in time, a new flight begins."""
        started_s = self._clock()
        stages, now_us = self.stages, frame.time_us
        stages.receive(frame, plant_status)
        due = stages.loop.is_due(now_us)
        before_us = stages.time_us
        begins = before_us is None or not 0 < now_us - before_us <= self._longest_us
        known = stages.estimate(frame, now=due or begins)
        if known is None:
            stages.wait(now_us)
            standing = ActuatorCommand(now_us, (0.0,) * ROTORS, armed=False)
            return Step(standing, None, self._clock() - started_s, known=False)
        stages.enter(known, now_us, begins=begins)
        flown: ControlSample | None = None
        decision = estimate = asked = references = None
        if due:
            flown = stages.guard(STEP, self._sample, nothing, known, now_us)
            decision = stages.rescue(known, now_us) if flown is None else flown.decision
            estimate, asked = stages.state_source.estimate, frame
        command = stages.actuate(now_us)
        stages.delay.sent(command)
        duration_s = self._clock() - started_s
        if flown is not None:
            references = flown.guidance.horizon
            stages.sampled(flown, duration_s)
        faults, delay_us = stages.faults(), stages.delay.delay_us
        return Step(command, decision, duration_s, estimate, faults, True, delay_us, asked, references)

    def is_due(self, time_us: int) -> bool:
        """Whether the frame of a time is a control sample."""
        return self.stages.loop.is_due(time_us)

    def next_us(self, now_us: int) -> int:
        """Return the time of the next frame after a control sample whose content matters."""
        stages = self.stages
        return now_us + (stages.loop.control_interval_us if stages.repeats else self.frame_interval_us)

    def go_on(self, now_us: int) -> None:
        """Go on to the frame of a time before `next_us`, without its content."""
        self.stages.time_us = now_us

    def serve(self, inbox: Iterable[Received] = ()) -> "list[Outgoing]":
        return self.stages.serve(inbox)

    def _sample(self, known: StateFrame, now_us: int) -> ControlSample:
        stages = self.stages
        state = stages.loop.observe(known)
        ahead = self._ahead(known, state)
        stages.supervise(now_us, ahead)
        guidance = stages.guide(now_us, ahead)
        return ControlSample(now_us, state, guidance, stages.decide(now_us, ahead, guidance))

    def _ahead(self, known: StateFrame, state: VehicleState) -> VehicleState:
        stages = self.stages
        if stages.delay.delay_us == 0:
            return state
        return stages.guard(DELAY, lambda: stages.loop.observe(stages.ahead(known)), lambda: state)
