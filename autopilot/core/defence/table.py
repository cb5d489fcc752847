"""The table of the parts of a vehicle whose exceptions are caught in flight, and of what flies in place of each."""

from typing import Final, NamedTuple


class Part(NamedTuple):
    """A part.

    Attributes:
        name: As it is reported.
        instead: What replaces it while it raises, as it is reported.
        optional: Whether it is left out for good once it has raised `TRIES` times; others are tried again each time.
    """

    name: str
    instead: str
    optional: bool = False


TRIES = 3
"""A part that raises so often is off."""

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
        Part(BATTERY, "charge no longer known", optional=True),
        Part(RESTART, "nothing goes on of the flight before"),
        Part(START, "begun anew"),
        Part(ESTIMATOR, "inertial sensors carry on"),
        Part(STANDBY, "attitude stays as it was"),
        Part(DELAY, "the delay is not compensated", optional=True),
        Part(ROTOR_WATCH, "lost rotors may go unnoticed", optional=True),
        Part(SETPOINTS, "none are taken"),
        Part(FAILSAFES, "none may act", optional=True),
        Part(TASK, "hold"),
        Part(GUIDANCE, "descending"),
        Part(LAW, "plain law flies"),
        Part(THREE_ROTORS, "last command stays"),
        Part(PLAIN_LAW, "last command stays"),
        Part(FAULTS, "none are injected"),
        Part(STEP, "descending"),
        Part(TELEMETRY, "old values are sent", optional=True),
        Part(STATIONS, "not served in this frame"),
        Part(DATAGRAM, "dropped"),
        Part(PARAMETERS, "old values stay"),
        Part(PROGRESS, "not reported"),
        Part(HUB, "not polled in this frame"),
        Part(LOG, "not recorded"),
        Part(CHECKPOINT, "none for a restart", optional=True),
        Part(PROCESS, "left out"),
    )
}
"""All of them; services of the hub are parts under names of their own."""
