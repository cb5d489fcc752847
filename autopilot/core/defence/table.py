"""The parts whose exceptions are caught in flight, and their replacements."""

from typing import Final, NamedTuple


class DefendedPart(NamedTuple):
    """A part, and its replacement as reported."""

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
CHECKPOINT: Final = "checkpoint"
PROCESS: Final = "process"

PARTS: Final = {
    BATTERY: DefendedPart("charge no longer known", optional=True),
    RESTART: DefendedPart("the previous flight is not resumed"),
    START: DefendedPart("begun anew"),
    ESTIMATOR: DefendedPart("inertial sensors carry on"),
    STANDBY: DefendedPart("attitude stays as it was"),
    DELAY: DefendedPart("the delay is not compensated", optional=True),
    ROTOR_WATCH: DefendedPart("lost rotors may go unnoticed", optional=True),
    SETPOINTS: DefendedPart("none are taken"),
    FAILSAFES: DefendedPart("none may act", optional=True),
    TASK: DefendedPart("hold"),
    GUIDANCE: DefendedPart("descending"),
    LAW: DefendedPart("plain law flies"),
    THREE_ROTORS: DefendedPart("last command stays"),
    PLAIN_LAW: DefendedPart("last command stays"),
    FAULTS: DefendedPart("none are injected"),
    STEP: DefendedPart("descending"),
    TELEMETRY: DefendedPart("old values are sent", optional=True),
    STATIONS: DefendedPart("not served in this frame"),
    DATAGRAM: DefendedPart("dropped"),
    PARAMETERS: DefendedPart("old values stay"),
    "progress": DefendedPart("not reported"),
    "hub": DefendedPart("not polled in this frame"),
    "flight log": DefendedPart("not recorded"),
    CHECKPOINT: DefendedPart("none for a restart", optional=True),
    PROCESS: DefendedPart("left out"),
}
"""Services of the hub are parts under names of their own."""


def nothing() -> None: ...
