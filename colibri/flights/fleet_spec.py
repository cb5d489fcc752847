"""The options of `colibri sitl`."""

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated

from colibri.autopilot.spec import GroundSpec
from colibri.common.earth.home import DEFAULT_HOME, HomePlace
from colibri.common.earth.home import home as read_home
from colibri.common.spec import Option
from colibri.flights.spec import VehiclesSpec
from colibri.mavlink.services.identity import IdentityName

PLANT_PORT = 14560
GROUND_PORT = 14550
SDK_PORT = 14540
TCP_PORT = 5760
_CONNECT = (
    "connect: mavproxy.py --master=tcp:127.0.0.1:{tcp}; Mission Planner: TCP, 127.0.0.1, {tcp}; "
    'dronekit.connect("tcp:127.0.0.1:{tcp}", wait_ready=True); QGroundControl by itself (UDP {ground})'
)
"""How clients of ArduPilot connect; those of PX4 do by themselves."""


def ports(instance: int) -> dict[str, int]:
    return {"ground": GROUND_PORT, "sdk": SDK_PORT + instance, "tcp": TCP_PORT + 10 * instance}


@dataclass(frozen=True, kw_only=True)
class FleetSpec(VehiclesSpec, GroundSpec):
    """Vehicles for ground stations to connect to."""

    instance: Annotated[int, Option("number of the first vehicle; its system id is N + 1", "N", least=0)] = 0
    count: Annotated[int, Option("number of vehicles", "N", least=0)] = 1
    home: Annotated[
        HomePlace, Option("origin, degrees and m; yaw clockwise from north", "LAT,LON,ALT,YAW", read=read_home)
    ] = DEFAULT_HOME
    spacing: Annotated[
        float, Option("distance between the vehicles of a fleet, in a row to the east", "M", "m", least=0.0)
    ] = 3.0
    identity: Annotated[IdentityName, Option("identity for ground stations")] = "px4"
    state: Annotated[Path, Option("folder for parameters and logs", "DIR")] = Path("out/sitl")
    out: Annotated[
        Path | None, Option("folder for the logs of vehicle N in DIR/N, for `colibri replay` (default: none)", "DIR")
    ] = None
    plant_port: Annotated[
        int | None, Option("UDP port of the plant (default: 14560 + N; 0: any free one)", "PORT", least=0, most=65535)
    ] = None
    speed: Annotated[float, Option("multiple of real time, or max", "N", above=0.0, endless=True)] = 1.0
    duration: Annotated[
        float, Option("end after this simulated time (default: never)", "S", "s", above=0.0, endless=True)
    ] = inf
    strict: Annotated[bool, Option("end at an exception in flight (default: replace the failed part)")] = False

    def folder(self, instance: int) -> Path | None:
        return None if self.out is None else self.out / str(instance)

    def connect(self) -> str:
        """Return how clients connect; empty where they do by themselves."""
        told = self.identity == "ardupilot" and not self.gcs
        return _CONNECT.format(**ports(self.instance)) if told else ""

    def links(self, instance: int) -> list[str]:
        sdk = "tcpin:127.0.0.1:{tcp}" if self.identity == "ardupilot" else "udpout:127.0.0.1:{sdk}"
        return list(self.gcs) or [link.format(**ports(instance)) for link in ("udpout:127.0.0.1:{ground}", sdk)]
