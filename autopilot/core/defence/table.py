"""The parts whose exceptions are caught in flight, and their replacements."""

from typing import Final, NamedTuple


class DefendedPart(NamedTuple):
    """A part, and its replacement as reported."""

    name: str
    instead: str
    optional: bool = False  # off after `TRIES` exceptions; others are tried again each time


TRIES = 3

BATTERY: Final = "battery monitor"
RESTART: Final = "restart"
START: Final = "flight start"
ESTIMATOR: Final = "estimator"
STANDBY: Final = "inertial estimate"
DELAY: Final = "delay compensation"
ROTOR_WATCH: Final = "rotor watch"
SETPOINTS: Final = "setpoints"
FAILSAFES: Final = "failsafes"
TASK: Final = "flight task"
GUIDANCE: Final = "guidance"
LAW: Final = "control law"
THREE_ROTORS: Final = "three rotors"
PLAIN_LAW: Final = "plain law"
FAULTS: Final = "injected faults"
STEP: Final = "step"
TELEMETRY: Final = "telemetry"
STATIONS: Final = "ground stations"
DATAGRAM: Final = "datagram"
PARAMETERS: Final = "parameters"
PROGRESS: Final = "progress"
HUB: Final = "hub"
LOG: Final = "flight log"
CHECKPOINT: Final = "checkpoint"
PROCESS: Final = "process"

PARTS: Final = {
    part.name: part
    for part in (
        DefendedPart(BATTERY, "charge no longer known", optional=True),
        DefendedPart(RESTART, "the previous flight is not resumed"),
        DefendedPart(START, "begun anew"),
        DefendedPart(ESTIMATOR, "inertial sensors carry on"),
        DefendedPart(STANDBY, "attitude stays as it was"),
        DefendedPart(DELAY, "the delay is not compensated", optional=True),
        DefendedPart(ROTOR_WATCH, "lost rotors may go unnoticed", optional=True),
        DefendedPart(SETPOINTS, "none are taken"),
        DefendedPart(FAILSAFES, "none may act", optional=True),
        DefendedPart(TASK, "hold"),
        DefendedPart(GUIDANCE, "descending"),
        DefendedPart(LAW, "plain law flies"),
        DefendedPart(THREE_ROTORS, "last command stays"),
        DefendedPart(PLAIN_LAW, "last command stays"),
        DefendedPart(FAULTS, "none are injected"),
        DefendedPart(STEP, "descending"),
        DefendedPart(TELEMETRY, "old values are sent", optional=True),
        DefendedPart(STATIONS, "not served in this frame"),
        DefendedPart(DATAGRAM, "dropped"),
        DefendedPart(PARAMETERS, "old values stay"),
        DefendedPart(PROGRESS, "not reported"),
        DefendedPart(HUB, "not polled in this frame"),
        DefendedPart(LOG, "not recorded"),
        DefendedPart(CHECKPOINT, "none for a restart", optional=True),
        DefendedPart(PROCESS, "left out"),
    )
}
"""All of them; services of the hub are parts under names of their own."""


def nothing() -> None: ...
