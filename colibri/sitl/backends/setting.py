"""The setting of a flight, and the command lines of its two processes.

Nothing here loads plant or autopilot: pytest imports it in every run.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path, PurePath
from typing import Any

import msgspec

from colibri.flights.command_lines import options_of, plant_options
from colibri.plant.simulation.setting import WorldSetting
from colibri.sitl.backends.link_faults import Trouble
from colibri.sitl.errors import SitlError

_STANDING = {"x": 0.0, "y": 0.0, "z": 0.0, "psi": 90.0, "rotors": 0.0}
"""On its feet at the origin, its nose to the north."""


class SettingError(SitlError):
    """A flight that cannot begin so; the message is the one line that a user needs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting(WorldSetting):
    """The setting of a flight; each field is the option of the same name of `colibri plant` or `autopilot`.

    Beside what a `WorldSetting` has, whose seed is that of the links' faults, too. What is left out of `start` is that
    of a vehicle that stands, nose to the north; x, y, z count from there.

    Attributes:
        vehicle: That the plant flies, name or .toml.
        believed: That the autopilot controls; None for the same.
        profile: Control profile, name or .toml.
        controller: Control law; None for the profile's.
        feedback: What the plant sends to the autopilot: "state" or "sensors".
        airborne: Picked up in hold so many metres above the origin, its rotors at hover speed: no take-off needed.
            With feedback "state" only: an estimator begins at rest.
        params: Parameters that were changed before.
        track: Flown from time 0 on; the vehicle must be in the air.
        home: "LAT,LON,ALT,YAW": the origin of the ENU frame.
        ground: What links to ground stations do: loss, delay_s, jitter_s, duplicate, reorder, corrupt, as in `Trouble`.
        identity: Towards ground stations: "px4" or "generic".
        system: MAVLink system id.
        strict: Whether what a part of the autopilot raises in flight fails the test, rather than being replaced.
        ready: Whether the flight is handed over only after the first HEARTBEAT.
    """

    vehicle: str = "hummingbird"
    believed: str | None = None
    profile: str = "flight"
    controller: str | None = None
    feedback: str = "state"
    airborne: float | None = None
    params: Mapping[str, int | float] = field(default_factory=dict)
    track: str | None = None
    home: str | None = None
    ground: Mapping[str, float] = field(default_factory=dict)
    identity: str = "px4"
    system: int = 1
    strict: bool = True
    ready: bool = True

    def plant_options(self, hover_rpm: float) -> list[str]:
        """Return the command line of the plant, whose rotors hover at `hover_rpm`."""
        start = dict(_STANDING)
        if self.airborne is not None:
            start |= {"z": self.airborne, "rotors": hover_rpm}
        world = replace(self, start=start | dict(self.start))
        return plant_options(world, vehicle=self.vehicle, system_id=self.system, home=self.home, truth=True)

    def autopilot_options(self, state: Path) -> list[str]:
        """Return the command line of an autopilot that keeps its files in folder `state`."""
        return options_of(
            vehicle=self.believed or self.vehicle,
            profile=self.profile,
            controller=self.controller,
            feedback=self.feedback,
            track=self.track,
            home=self.home,
            identity=self.identity,
            system_id=self.system,
            state=state,
            strict=self.strict,
        )


KEYS = frozenset(each.name for each in fields(Setting))
DOES = frozenset(each.name for each in fields(Trouble)) - {"down"}
_NUMBERS = ("start", "ground")
"""What is read from KEY=VALUE,... where it is text."""


def setting_of(marks: Iterable[Mapping[str, Any]]) -> Setting:
    """Return the setting that several marks describe together, where a later one overrides; params add up.

    Raises:
        SettingError: One has a key that no setting has, or a wrong value.
    """
    values: dict[str, Any] = {"params": {}}
    for mark in marks:
        unknown = sorted(set(mark) - KEYS)
        if unknown:
            raise SettingError(f"a flight has no {unknown[0]}: choose {', '.join(sorted(KEYS))}")
        params = _numbers("params", mark.get("params", {}))
        values |= {**mark, "params": values["params"] | params}
    for name in ("gusts", "without"):
        if isinstance(values.get(name), str):
            values[name] = (values[name],)
    values |= {name: _numbers(name, values[name]) for name in _NUMBERS if name in values}
    unknown = sorted(set(values.get("ground", ())) - DOES)
    if unknown:
        raise SettingError(f"a link has no {unknown[0]} to begin with: choose {', '.join(sorted(DOES))}")
    try:
        Trouble(**values.get("ground", {}))
        setting = msgspec.convert({name: _plain(value) for name, value in values.items()}, Setting)
    except msgspec.ValidationError as error:
        wrong, _, where = str(error).partition(" - at `$.")
        raise SettingError(f"{where.rstrip('`')}: {wrong.replace('`', '').replace('null', 'None')}") from None
    except ValueError as error:
        raise SettingError(str(error)) from None
    if setting.airborne is not None and setting.feedback == "sensors":
        raise SettingError('airborne is for feedback "state": an estimator begins at rest, so stand, and take off')
    return setting


def _numbers(name: str, given: object) -> Mapping[str, int | float]:
    """Return numbers by name, given so or as KEY=VALUE,...; whole ones stay whole.

    Raises:
        SettingError: They are not.
    """
    try:
        pairs = [pair.split("=", 1) for pair in given.split(",")] if isinstance(given, str) else given
        return {str(key): _number(value) for key, value in dict(pairs).items()}  # type: ignore[call-overload]
    except (ValueError, TypeError):
        raise SettingError(f"{name} is KEY=VALUE,... in numbers, not {given!r}") from None


def _number(value: Any) -> int | float:
    if isinstance(value, str) and value.strip().lstrip("+-").isdigit():
        return int(value)
    return value if isinstance(value, int) else float(value)


def _plain(value: Any) -> Any:
    """Return a path as text, and a number of numpy's as Python's."""
    if isinstance(value, PurePath):
        return str(value)
    return value.item() if hasattr(value, "item") else value
