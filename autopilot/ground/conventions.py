"""The conventions of an identity: one table, read by the services. The identities are in `autopilot/identities`."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias

from colibri.autopilot.commander.commands import Commands
from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_selection import ModeSelection
from colibri.autopilot.commander.mode_tasks import ModeTasks
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.shown_modes import PX4_MODES, ModeBook
from colibri.autopilot.ground.fault_injection import Failures
from colibri.autopilot.ground.onboard_log import ULOG, LogFormat
from colibri.autopilot.ground.system_commands import SystemCommands
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.node.service import Service
from colibri.mavlink.parameters.store import Parameter, Parameters, Value
from colibri.mavlink.services.identity import Identity
from colibri.mavlink.setpoints.offboard import LOCAL_FRAMES, Frame
from colibri.mavlink.streaming.rates import PX4_STREAMS, Streams
from colibri.mavlink.streaming.service import StreamService
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot


class Commanded(NamedTuple):
    pilot: Pilot
    fence: Fence
    missions: Missions
    needs: ModeNeeds
    tasks: ModeTasks
    parameters: Parameters
    book: ModeBook


class Served(Protocol):
    """What the further services of an identity read and do."""

    snapshot: TelemetrySnapshot | None
    modes: ModeSelection
    system: SystemCommands
    parameters: Parameters
    needs: ModeNeeds
    streams: StreamService
    failures: Failures
    pilot: Pilot
    banner: tuple[str, ...]

    @property
    def takeoff_by_stick(self) -> Callable[[float], None]: ...

    def say(self, severity: int, text: str) -> None: ...


Rewrite: TypeAlias = Callable[[str], str]
"""Returns a status text in the words of the emulated program; empty if it sends none."""


def _px4_commands(parts: Commanded) -> Commands:
    return Commands(parts.pilot, parts.fence, parts.missions, parts.needs, parts.book)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conventions:
    """The conventions of an identity.

    Attributes:
        wire: What MAVLink services read.
        commands: Makes the handlers of commands.
        frames: Local frames of setpoints.
        streams: Messages, their groups and default rates.
        radio: Channels of the radio without overrides, us; empty: sticks come by MAVLink alone.
        parameters: Makes the parameters from Colibri's own, with a system id.
        folder_suffix: Ending of the parameter file's name.
        logs: Format of flight logs.
        booted: Returns the saved parameters as they are after a start.
        kept_plans: Returns the types of plans that a start does not clear.
        rewrite: Puts a status text into the program's words.
        banner: Status texts at the start, beside Colibri's own.
        describe: Returns the text of a mission item that begins.
        services: Makes further services.
    """

    wire: Identity
    modes: ModeBook = PX4_MODES
    commands: Callable[[Commanded], Commands] = _px4_commands
    frames: dict[int, Frame] | None = None
    streams: Streams = PX4_STREAMS
    radio: tuple[int, ...] = ()
    parameters: Callable[[Iterable[Parameter], int], Parameters] = lambda ours, _: Parameters(ours)
    folder_suffix: str = ""
    logs: LogFormat = ULOG
    booted: Callable[[dict[str, Value]], dict[str, Value]] = lambda values: values
    kept_plans: Callable[[Parameters], Collection[int]] = lambda _: ()
    rewrite: Rewrite = str
    banner: tuple[str, ...] = ()
    describe: Callable[[int, MissionItem], str] | None = None
    services: Callable[[Served], Sequence[Service]] = lambda _: ()

    @property
    def local_frames(self) -> dict[int, Frame]:
        return self.frames or LOCAL_FRAMES
