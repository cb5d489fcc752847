"""The step of an autopilot, and the answer to a datagram of the plant."""

from collections.abc import Callable
from typing import NamedTuple

from colibri.autopilot.control.interface import Decision, Horizon
from colibri.autopilot.estimation.estimate import Estimate
from colibri.common.records import Record
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.hil.px4_autopilot import FlierEnd
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.hil.world_changes import WorldChange


class Step(Record, frozen=True):
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


def answer(
    end: AutopilotEnd | FlierEnd, step: Callable[[Frame, PlantStatus], Step], datagram: bytes, now_s: float
) -> Step | None:
    """Answer a plant's datagram; None if it contains no frame, DecisionError beyond the limits of the rotors."""
    received = end.receive(datagram, now_s)
    if received is None:
        return None
    answered = step(received.frame, received.plant_status)
    end.answer(answered.command, answered.faults)
    return answered


class Received(NamedTuple):
    """A datagram of a ground station, and whether it may set up signing (`owner`)."""

    datagram: bytes
    link: int
    address: tuple[str, int] | None
    owner: bool = True
