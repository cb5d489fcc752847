"""The setting of a flight."""

from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Annotated, Any

from colibri.autopilot.process.planned_events import station_events
from colibri.autopilot.spec import AutopilotSpec, LawSpec
from colibri.common.earth.home import DEFAULT_HOME, HomePlace
from colibri.common.earth.home import home as read_home
from colibri.common.errors import unknown
from colibri.common.spec import Option, part_of, read_values
from colibri.mavlink.client.events import EventError
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.services.identity import IdentityName
from colibri.plant.events import check_events, plant_events
from colibri.plant.physics.start import Start
from colibri.plant.spec import PlantSpec, WorldSpec
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from colibri.sitl.backends.link_faults import Trouble
from colibri.sitl.errors import SitlError

_STANDING = Start(psi=90.0)  # at rest on its feet at the origin, facing north


class SettingError(SitlError):
    """A setting with which a flight cannot begin."""


def _numbers(text: str) -> dict[str, int | float]:
    try:
        return {key: _number(value) for key, _, value in (pair.partition("=") for pair in text.split(","))}
    except ValueError:
        raise ArgumentTypeError(f"must be KEY=VALUE,... in numbers, not {text}") from None


def _number(text: str) -> int | float:
    return int(text) if text.strip().lstrip("+-").isdigit() else float(text)


@dataclass(frozen=True, kw_only=True)
class Setting(WorldSpec, LawSpec):
    """The setting of a flight.

    The seed also seeds link faults. The default start is standing at the origin, facing north.
    """

    vehicle: Annotated[str | Vehicle, Option("vehicle of the plant, name or .toml")] = "hummingbird"
    believed: Annotated[str | Vehicle | None, Option("vehicle assumed by the autopilot (default: the same)")] = None
    airborne: Annotated[
        float | None,
        Option(
            "start in mode HOLD at this height in m above the origin, rotors at hover speed, without take-off; only "
            'with feedback "state"',
            unit="m",
        ),
    ] = None
    params: Annotated[Mapping[str, int | float], Option("changed parameters", read=_numbers)] = field(
        default_factory=dict
    )
    track: Annotated[str | None, Option("track from time 0 on; the vehicle must start in the air")] = None
    home: Annotated[HomePlace, Option("LAT,LON,ALT,YAW: the origin of the ENU frame", read=read_home)] = DEFAULT_HOME
    ground: Annotated[
        Mapping[str, float],
        Option(
            "links to ground stations: loss, delay_s, jitter_s, duplicate, reorder, corrupt, as in `Trouble`",
            read=_numbers,
        ),
    ] = field(default_factory=dict)
    identity: Annotated[IdentityName, Option("towards ground stations")] = "px4"
    system: Annotated[int, Option("MAVLink system id", least=1, most=255)] = 1
    strict: Annotated[bool, Option("fail the test if a part of the autopilot raises, instead of replacing it")] = True
    ready: Annotated[bool, Option("begin the test after the first HEARTBEAT")] = True

    @property
    def rotors(self) -> int:
        return load_vehicle(self.vehicle).rotors.count

    def plant_spec(self) -> PlantSpec:
        start = _STANDING
        if self.airborne is not None:
            start = start._replace(z=self.airborne, rotors=load_vehicle(self.vehicle).hover_rpm)
        begins = self.started(start)._asdict()
        events = plant_events(self.events)
        return part_of(self, PlantSpec, system_id=self.system, start=begins, truth=True, speed=inf, events=events)

    def autopilot_spec(self, state: Path) -> AutopilotSpec:
        """Return the specification of an autopilot with its files in `state`."""
        vehicle = self.believed or self.vehicle
        return part_of(self, AutopilotSpec, vehicle=vehicle, system_id=self.system, state=state, events=())


DOES = frozenset(Trouble.__slots__) - {"down"}


def setting_of(marks: Iterable[Mapping[str, Any]]) -> Setting:
    """Merge marks into a setting: later ones override, params add up."""
    values: dict[str, Any] = {}
    for mark in marks:
        read = read_values(Setting, mark, SettingError)
        values |= read | {"params": {**values.get("params", {}), **read.get("params", {})}}
    try:
        setting = Setting(**values)
        if setting.events:
            station_events(setting.events)
            on_sensors = setting.feedback is Feedback.SENSORS
            check_events(setting.events, load_vehicle(setting.vehicle), on_sensors=on_sensors, served=True)
    except EventError as error:
        raise SettingError(f"events: {error}") from None
    unknown_faults = sorted(set(setting.ground) - DOES)
    if unknown_faults:
        raise SettingError(f"ground: {unknown('fault', unknown_faults[0], sorted(DOES))}")
    try:
        Trouble(**dict[str, Any](setting.ground))
    except ValueError as error:
        raise SettingError(str(error)) from None
    if setting.airborne is not None and setting.feedback is Feedback.SENSORS:
        raise SettingError('airborne requires feedback="state": the estimator must start at rest')
    return setting
