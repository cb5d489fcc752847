"""The flights of one test: begun by its marks, on the link that the command line chose, and ended with it."""

import json
from argparse import ArgumentTypeError
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import definitions
from colibri.common.earth.geodesy import Geodetic
from colibri.common.earth.home import DEFAULT_HOME, home
from colibri.common.process.lifecycle import freeze_once
from colibri.mavlink.parameters.file import write
from colibri.mavlink.parameters.store import Parameters
from colibri.plant.vehicle.description import VehicleError, load_vehicle
from colibri.sitl.backends.launcher import Launcher
from colibri.sitl.backends.link_clocks import QuickClock
from colibri.sitl.backends.lockstep import Autopilot, LockstepSession, Plant
from colibri.sitl.backends.memory import MemoryAutopilot, MemoryPlant
from colibri.sitl.backends.setting import Setting, SettingError, setting_of
from colibri.sitl.backends.udp import UdpAutopilot, UdpPlant
from colibri.sitl.flight_figure import draw
from colibri.sitl.flight_record import FACTS, FIGURE
from colibri.sitl.vehicle import Sitl


class Flights:
    """All that a test flies.

    Attributes:
        setting: What each begins with, but for changes.
        flown: The flights, in the order in which they were begun.
    """

    def __init__(self, setting: Setting, launcher: Launcher | None) -> None:
        """Fly by `setting`, in processes of a `launcher`, or in this one."""
        self.setting = setting
        self._launcher = launcher
        freeze_once()  # a run of tests has a lot that is there to stay
        self._ends = ExitStack()
        self._folder = Path(self._ends.enter_context(TemporaryDirectory(prefix="sitl-")))
        self.flown: list[Sitl] = []

    def begin(self, **changes: Any) -> Sitl:
        """Begin a flight that differs from the test's setting by `changes`; their `params` add up.

        Raises:
            SettingError: It cannot begin so.
        """
        setting = setting_of([asdict(self.setting), changes])
        state = self._folder / f"vehicle-{len(self.flown)}"
        sitl = Sitl(setting, self._lockstep(setting, state), origin_of(setting))
        self.flown.append(sitl)
        sitl.begin()
        return sitl

    def _lockstep(self, setting: Setting, state: Path) -> LockstepSession:
        state.mkdir()
        _write_parameters(setting, state)
        plant = self._plant(setting.plant_options(_hover_rpm(setting)), state)
        self._ends.callback(plant.close)
        autopilot = self._autopilot(setting.autopilot_options(state), state)
        self._ends.callback(autopilot.close)
        return LockstepSession(plant, autopilot, setting.system, setting.seed)

    def _plant(self, options: Sequence[str], state: Path) -> Plant:
        if self._launcher is None:
            return MemoryPlant(options)
        if not self._launcher.starts_plants:
            return MemoryPlant(options, QuickClock())
        return UdpPlant(self._launcher, options, state)

    def _autopilot(self, options: Sequence[str], state: Path) -> Autopilot:
        return MemoryAutopilot(options) if self._launcher is None else UdpAutopilot(self._launcher, options, state)

    def keep(self, folder: Path, *, figures: bool = True, title: str = "", reason: str = "") -> list[Path]:
        """Write all that is known of the flights below `folder`; return where each is.

        Args:
            folder: Made where it is missing.
            figures: Whether to draw them, too.
            title: Of the figures: what was flown.
            reason: Why it ended, said beside the mark at the end.
        """
        places = []
        for number, sitl in enumerate(self.flown):
            place = folder / f"flight-{number}" if len(self.flown) > 1 else folder
            sitl.record.keep(place)
            if figures and sitl.record.frames:
                heading = f"vehicle {sitl.system}: {title}" if len(self.flown) > 1 else title
                flown, texts = sitl.record.columns(), sitl.timed_texts
                draw(flown, texts, place / FIGURE, failed_s=sitl.time_s, title=heading, reason=reason)
            facts = {
                "test": title,
                "reason": reason,
                "setting": asdict(sitl.setting),
                "sha256": sitl.sha256,
                "simulated_s": sitl.time_s,
                "ended": str(sitl),
                "texts": sitl.texts,
            }
            (place / FACTS).write_text(json.dumps(facts, indent=1, default=str) + "\n", encoding="utf-8")
            places.append(place)
        return places

    def summary(self) -> dict[str, Any]:
        """Return their number, simulated time, s, and hashes, for the summary of the run."""
        return {
            "flights": len(self.flown),
            "simulated_s": sum(sitl.time_s for sitl in self.flown),
            "sha256": [sitl.sha256 for sitl in self.flown],
        }

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, *_: object) -> None:
        """End every flight."""
        self._ends.close()


def origin_of(setting: Setting) -> Geodetic:
    """Return the origin of a flight's ENU frame.

    Raises:
        SettingError: There is no such place.
    """
    try:
        return (DEFAULT_HOME if setting.home is None else home(setting.home)).origin
    except ArgumentTypeError as error:
        raise SettingError(f"home: {error}") from error


def _hover_rpm(setting: Setting) -> float:
    try:
        vehicle = load_vehicle(setting.vehicle)
    except VehicleError as error:
        raise SettingError(str(error)) from error
    return vehicle.hover_speed / vehicle.speed_from_rpm(1.0)


def _write_parameters(setting: Setting, state: Path) -> None:
    """Write the parameters that the autopilot is to begin with, as it would have kept them.

    Raises:
        SettingError: There is no such parameter, or it cannot have the value.
    """
    if not setting.params:
        return
    profile = load_profile(setting.profile).with_choices(setting.controller, None)
    vehicle = load_vehicle(setting.believed or setting.vehicle)
    parameters = Parameters(definitions(profile, vehicle, setting.system))
    _set(parameters, setting.params)
    name = f"{profile.controller}-{vehicle.name.lower().replace(' ', '-')}.params"
    (state / name).write_text(write(parameters, setting.system), encoding="utf-8")


def _set(parameters: Parameters, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        if name not in parameters:
            raise SettingError(f"the vehicle has no parameter {name}")
        refusal = parameters.set(name, value)
        if refusal is not None:
            raise SettingError(f"parameter {name} cannot be {value:g}: {refusal.name}")
