"""Cases by seed."""

import random
from typing import NamedTuple

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.behaviour import TRACKS
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.hil import faults
from colibri.mavlink.parameters.store import Parameter, ParamType, Value
from colibri.plant.vehicle.description import load_vehicle

VEHICLES = ("hummingbird", "hummingbird-rangefinder", "iris", "jmavsim")
MODES = (Mode.HOLD, Mode.RETURN, Mode.LAND, Mode.MISSION, Mode.OFFBOARD, Mode.POSITION, Mode.ALTITUDE)
_DRAWN = ("BAT_", "CBRK_", "COM_", "GF_", "MIS_", "MPC_", "NAV_", "RTL_", "TRK_")
_KEPT = ("COM_DISARM_LAND",)
"""Without it no flight ends by itself."""
_BY_STATE = (faults.MOTOR, faults.BATTERY)
"""Faults that act on flights without sensors."""


class RandomEvent(NamedTuple):
    """An event `after_s` seconds of the one before."""

    after_s: float
    what: str
    values: tuple[float | str, ...] = ()

    def __str__(self) -> str:
        return " ".join((self.what, *(f"{value:.3g}" if isinstance(value, float) else value for value in self.values)))


class RandomFlight(NamedTuple):
    """A flight, and its events from the take-off on."""

    seed: int
    vehicle: str
    feedback: str
    wind: str
    turbulence: str | None
    params: dict[str, Value]
    height_m: float
    radius_m: float  # of the fence around home
    events: list[RandomEvent]

    @property
    def well(self) -> bool:
        """Whether vehicle and ground station stay well."""
        return all(event.what not in ("inject", "silence") for event in self.events)

    @property
    def lands(self) -> bool:
        """Whether the vehicle should land whatever happens: at most one of its sensors fails."""
        failed = [str(event.values[0]) for event in self.events if event.what == "inject"]
        return not failed or (len(failed) == 1 and failed[0].startswith("SENSOR_"))

    def __str__(self) -> str:
        weather = f"wind {self.wind}" + (f", turbulence {self.turbulence}" if self.turbulence else "")
        params = ", ".join(f"{name} {value:.6g}" for name, value in self.params.items())
        events = "; ".join(f"{event.after_s:.1f} s: {event}" for event in self.events)
        return f"{self.vehicle}, {self.feedback}, {weather}; {params or 'no parameters'}; {events}"


def case_of(seed: int) -> RandomFlight:
    chance = random.Random(seed)
    vehicle, feedback = chance.choice(VEHICLES), chance.choice(("state", "sensors", "sensors"))
    wind = f"{chance.choice((0.0, chance.uniform(0.0, 6.0), chance.uniform(0.0, 10.0))):.1f}@{chance.randrange(360)}"
    turbulence = chance.choice((None, None, "light", "moderate"))
    all_known = definitions(load_profile("flight"), load_vehicle(vehicle))
    known = [it for it in all_known if it.name.startswith(_DRAWN) and it.name not in _KEPT and not it.read_only]
    params = {it.name: _value(chance, it) for it in chance.sample(known, chance.randrange(6))}
    events = [_mode(chance) for _ in range(chance.randint(2, 4))]
    events += [_failure(chance, feedback) for _ in range(chance.choice((0, 1, 1, 2)))]
    events += [
        RandomEvent(chance.uniform(1.0, 5.0), "wind", (f"{chance.uniform(0.0, 10.0):.1f}@{chance.randrange(360)}",))
    ]
    chance.shuffle(events)
    return RandomFlight(seed, vehicle, feedback, wind, turbulence, params, chance.uniform(3.0, 12.0), 25.0, events)


def _mode(chance: random.Random) -> RandomEvent:
    after_s = chance.uniform(0.5, 8.0)
    if chance.random() < 0.35:
        east_m, north_m = chance.uniform(-20.0, 20.0), chance.uniform(-20.0, 20.0)
        return RandomEvent(after_s, "goto", (east_m, north_m, chance.uniform(2.0, 15.0)))
    if chance.random() < 0.2:
        return RandomEvent(after_s, "fly", (chance.choice(TRACKS),))
    return RandomEvent(after_s, chance.choice(MODES), (chance.uniform(-1.0, 1.0), chance.uniform(-1.0, 1.0)))


def _failure(chance: random.Random, feedback: str) -> RandomEvent:
    after_s = chance.uniform(0.5, 8.0)
    if chance.random() < 0.15:
        return RandomEvent(after_s, "silence", (chance.uniform(1.0, 20.0),))
    rows = [row for row in faults.ROWS if row.kind != faults.OK]
    row = chance.choice([row for row in rows if feedback == "sensors" or row.unit in _BY_STATE])
    usual = [it.usual for it in row.values]
    times = chance.choice((1.0, 2.0 ** chance.uniform(-2.0, 4.0)))
    values = [min(max(it.usual * times, it.minimum), it.maximum) for it in row.values] if any(usual) else usual
    instance = float(chance.randint(1, row.instances))
    return RandomEvent(after_s, "inject", (faults.unit_name(row.unit), faults.kind_name(row.kind), instance, *values))


def _value(chance: random.Random, parameter: Parameter) -> Value:
    if parameter.values:
        return chance.choice(parameter.values)[0]
    low, high = max(parameter.minimum, -1e3), min(parameter.maximum, 1e3)
    drawn = parameter.default * 2.0 ** chance.uniform(-2.0, 2.0) if parameter.default else chance.uniform(low, high)
    drawn = min(max(drawn, low), high)
    return round(drawn) if parameter.kind is ParamType.INT else drawn
