"""The conventions of an identity as one table; the identities are in `autopilot/identities`."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from colibri.autopilot.commander.commands import Commands
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_selection import ModeSelection
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.shown_modes import PX4_MODES, ModeBook
from colibri.autopilot.ground.fault_injection import Failures
from colibri.autopilot.ground.onboard_log import ULOG, LogFormat
from colibri.autopilot.ground.system_commands import SystemCommands
from colibri.autopilot.guidance.mission.items import MISSION_RULES
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.mission.service import MissionService
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.node.service import Service
from colibri.mavlink.parameters.store import Parameter, Parameters, Value
from colibri.mavlink.services.identity import Identity
from colibri.mavlink.setpoints.offboard import Frame
from colibri.mavlink.streaming.rates import PX4_STREAMS, Streams
from colibri.mavlink.streaming.service import StreamService
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot


class Served(Protocol):
    """What the further services of an identity read and do."""

    snapshot: TelemetrySnapshot | None
    modes: ModeSelection
    system: SystemCommands
    parameters: Parameters
    streams: StreamService
    failures: Failures
    pilot: Pilot
    banner: tuple[str, ...]
    missions: Missions
    plans: MissionService

    @property
    def takeoff_by_stick(self) -> Callable[[float], None]: ...

    def say(self, severity: int, text: str) -> None: ...


PLACES = ("HOME_POSITION", "GPS_GLOBAL_ORIGIN")
Rewrite: TypeAlias = Callable[[str], str]
"""Returns a status text in the words of the emulated program; empty if it sends none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conventions:
    """The conventions of an identity.

    Attributes:
        parameters: Makes the parameters from Colibri's own and a system id.
        booted: Returns the saved parameters after a start.
        kept_plans: Returns the types of plans that a start does not clear.
    """

    wire: Identity
    modes: ModeBook = PX4_MODES
    commands: type[Commands] = Commands
    frames: dict[int, Frame] | None = None
    streams: Streams = PX4_STREAMS
    mission_rules: Rules = MISSION_RULES
    radio: tuple[int, ...] = ()  # channels without overrides, us; empty: sticks come by MAVLink alone
    parameters: Callable[[Iterable[Parameter], int], Parameters] = lambda ours, _: Parameters(ours)
    folder_suffix: str = ""  # ending of the parameter file's name
    logs: LogFormat = ULOG
    booted: Callable[[dict[str, Value]], dict[str, Value]] = lambda values: values
    kept_plans: Callable[[Parameters], Collection[int]] = lambda _: ()
    rewrite: Rewrite = str
    banner: tuple[str, ...] = ()  # status texts at the start, after Colibri's own
    describe: Callable[[int, MissionItem, bool], str] | None = None  # text of a mission item that begins or is reached
    loaded: Callable[[Parameters, int, int], None] = lambda *_: None  # of a plan's type, with its number of items
    services: Callable[[Served], Sequence[Service]] = lambda _: ()
