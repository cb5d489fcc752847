"""The step of an autopilot, and the answer to a datagram of the plant."""

from typing import NamedTuple, Protocol

from colibri.autopilot.control.interface import Decision, Horizon
from colibri.autopilot.estimation.estimate import Estimate
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.hil.px4_autopilot import FlierEnd
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.hil.world_changes import WorldChange


class Step(NamedTuple):
    """Answer to a frame: between control samples the last command, without a decision.

    Unless the vehicle is `known`, its rotors stand. Without ground stations, a decision has its frame and references.
    """

    command: ActuatorCommand
    decision: Decision | None
    duration_s: float
    estimate: Estimate | None = None
    faults: tuple[Fault | WorldChange, ...] = ()
    known: bool = True
    delay_us: int = 0
    frame: Frame | None = None
    references: Horizon | None = None


class Steps(Protocol):
    """An autopilot."""

    def step(self, frame: Frame, plant_status: PlantStatus) -> Step: ...


def answer(end: AutopilotEnd | FlierEnd, autopilot: Steps, datagram: bytes, now_s: float) -> Step | None:
    """Answer a plant's datagram; None if it contains no frame, DecisionError beyond the limits of the rotors."""
    received = end.receive(datagram, now_s)
    if received is None:
        return None
    step = autopilot.step(*received)
    end.answer(step.command, step.faults)
    return step


class Received(NamedTuple):
    """A datagram of a ground station, and whether it may set up signing (`owner`)."""

    datagram: bytes
    link: int
    address: tuple[str, int] | None
    owner: bool = True
