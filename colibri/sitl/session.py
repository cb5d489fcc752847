"""The flights of one test, alone or as a fleet in one simulated time."""

import json
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from colibri.common.process.lifecycle import freeze_once
from colibri.common.spec import values_of
from colibri.plant.vehicle.description import VehicleError
from colibri.sitl.backends.launcher import Launcher
from colibri.sitl.backends.link_faults import QuickClock
from colibri.sitl.backends.lockstep_session import LockstepSession, PlantSide
from colibri.sitl.backends.memory import MemoryAutopilot, MemoryPlant
from colibri.sitl.backends.setting import Setting, SettingError, setting_of
from colibri.sitl.backends.udp import UdpAutopilot, UdpPlant
from colibri.sitl.flight_record import FACTS, FIGURE, draw
from colibri.sitl.stepping import Stepped
from colibri.sitl.vehicle import Sitl


class Flights(AbstractContextManager["Flights"]):
    """All flights of a test; they end with it.

    Attributes:
        setting: The setting of the test's marks.
        flown: In the order of their start.
    """

    def __init__(self, setting: Setting, launcher: Launcher | None) -> None:
        self.setting = setting
        self._launcher = launcher
        freeze_once()  # a run of tests has a lot that is there to stay
        self._ends = ExitStack()
        self._folder = Path(self._ends.enter_context(TemporaryDirectory(prefix="sitl-")))
        self.flown: list[Sitl] = []

    def begin(self, **changes: Any) -> Sitl:
        """Begin a flight; `changes` override the test's setting, `params` add up."""
        setting = setting_of([values_of(self.setting), changes])
        state = self._folder / f"vehicle-{len(self.flown)}"
        sitl = Sitl(setting, self._lockstep(setting, state), setting.home.origin)
        self.flown.append(sitl)
        sitl.begin()
        return sitl

    def _lockstep(self, setting: Setting, state: Path) -> LockstepSession:
        state.mkdir()
        launcher = self._launcher
        plant: PlantSide
        try:
            if launcher is not None and launcher.starts_plants:
                plant = UdpPlant(launcher, setting.plant_spec(), state)
            else:
                plant = MemoryPlant(setting.plant_spec(), QuickClock() if launcher else None)
        except VehicleError as error:
            raise SettingError(str(error)) from error
        self._ends.callback(plant.close)
        spec = setting.autopilot_spec(state)
        autopilot = UdpAutopilot(launcher, spec, state) if launcher else MemoryAutopilot(spec)
        self._ends.callback(autopilot.close)
        return LockstepSession(plant, autopilot, setting.system, setting.rotors, setting.seed)

    def keep(self, folder: Path, *, figures: bool = True, title: str = "", reason: str = "") -> list[Path]:
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
                "setting": values_of(sitl.setting),
                "sha256": sitl.sha256,
                "simulated_s": sitl.time_s,
                "ended": str(sitl),
                "texts": sitl.texts,
            }
            (place / FACTS).write_text(json.dumps(facts, indent=1, default=str) + "\n", encoding="utf-8")
            places.append(place)
        return places

    def summary(self) -> dict[str, Any]:
        return {
            "flights": len(self.flown),
            "simulated_s": sum(sitl.time_s for sitl in self.flown),
            "sha256": [sitl.sha256 for sitl in self.flown],
        }

    def __exit__(self, *_: object) -> None:
        self._ends.close()


class Fleet(tuple[Sitl, ...], Stepped):
    """Vehicles that share one simulated time; flying one of them, or the fleet, flies all."""

    __slots__ = ()

    def __new__(cls, vehicles: Iterable[Sitl] = ()) -> "Fleet":
        fleet = super().__new__(cls, vehicles)
        for sitl in fleet:
            sitl.fleet = fleet
        if fleet:
            max(fleet, key=lambda sitl: sitl.time_us).have_others_catch_up()
        return fleet

    @property
    def time_us(self) -> int:
        """Simulated time of the last vehicle, µs."""
        return min(sitl.time_us for sitl in self)

    def step(self) -> None:
        min(self, key=lambda sitl: sitl.time_us).step()

    def __str__(self) -> str:
        return "; ".join(f"vehicle {sitl.system}: {sitl}" for sitl in self)


def begin_fleet(
    flights: Flights,
    count: int,
    *,
    spacing: float = 0.0,
    places: Sequence[tuple[float, float]] | None = None,
    **changes: Any,
) -> Fleet:
    """Begin a fleet.

    Args:
        spacing: Distance between neighbours to the east, m.
        places: East and north of each vehicle from the default start, m; replaces `spacing`.
        changes: Applied to the test's setting, for all vehicles.
    """
    if count < 1:
        raise SettingError(f"a fleet has at least one vehicle, not {count}")
    if places is None:
        places = [(number * spacing, 0.0) for number in range(count)]
    if len(places) != count:
        raise SettingError(f"places: expected one for each of {count} vehicles, found {len(places)}")
    begun = len(flights.flown)
    start = setting_of([{"start": changes.pop("start", flights.setting.start)}]).start
    vehicles = []
    for number, (east, north) in enumerate(places, begun + 1):
        place = {**start, "x": start.get("x", 0.0) + east, "y": start.get("y", 0.0) + north}
        vehicles.append(flights.begin(**{"system": number, "start": place, **changes}))
    return Fleet(vehicles)
