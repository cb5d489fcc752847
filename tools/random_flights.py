"""`python -m tools.random_flights`: flights by seeds, each with failures, parameters, modes and wind.

Each must raise nothing, report an impact, keep its fence as far as it can brake, be disarmed at its end, and take at
most 20 ms a frame. With at most one failed sensor it must not fall, hit the ground or overturn.
"""

import argparse
import random
import sys
from collections.abc import Callable
from math import dist, hypot, inf
from pathlib import Path
from time import perf_counter
from traceback import extract_tb
from typing import NamedTuple

from colibri.autopilot.commander.rules.modes import MANUAL, Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.behaviour import TRACKS
from colibri.autopilot.parameters.definitions import definitions
from colibri.common.process.arguments import seeds
from colibri.common.process.lifecycle import loading, use_one_thread
from colibri.common.types import Vector
from colibri.mavlink.hil import faults
from colibri.mavlink.parameters.store import Parameter, ParamType, Value
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl import mission_items as items
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.session import Flights
from colibri.sitl.stepping import NotInTimeError
from colibri.sitl.vehicle import Sitl
from tools.harness.frame_times import FrameTimes

VEHICLES = ("hummingbird", "hummingbird-rangefinder", "iris", "jmavsim")
MODES = (Mode.HOLD, Mode.RETURN, Mode.LAND, Mode.MISSION, Mode.OFFBOARD, Mode.POSITION, Mode.ALTITUDE)
_DRAWN = ("BAT_", "CBRK_", "COM_", "GF_", "MIS_", "MPC_", "NAV_", "RTL_", "TRK_")
_KEPT = ("COM_DISARM_LAND",)  # without it no flight ends by itself
_BY_STATE = (faults.MOTOR, faults.BATTERY)  # faults that act on flights without sensors


class RandomEvent(NamedTuple):
    """An event `after_s` seconds of the one before."""

    after_s: float
    what: str
    values: tuple[float | str, ...] = ()

    def __str__(self) -> str:
        return " ".join((self.what, *(f"{value:.3g}" if isinstance(value, float) else value for value in self.values)))


class RandomFlight(NamedTuple):
    seed: int
    vehicle: str
    feedback: str
    wind: str
    turbulence: str | None
    params: dict[str, Value]
    may_fall: bool  # a parameter asks for it after a failure
    height_m: float
    radius_m: float  # of the fence around home
    events: list[RandomEvent]

    @property
    def lands(self) -> bool:
        """Whether it should land: at most one sensor fails, and no parameter asks to fall."""
        if self.may_fall:
            return False
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
    drawn = chance.sample(known, chance.randrange(6))
    params = {it.name: _value(chance, it) for it in drawn}
    may_fall = any("terminate" in dict(it.values).get(int(params[it.name]), "").lower() for it in drawn)
    events = [_mode(chance) for _ in range(chance.randint(2, 4))]
    events += [_failure(chance, feedback) for _ in range(chance.choice((0, 1, 1, 2)))]
    events += [
        RandomEvent(chance.uniform(1.0, 5.0), "wind", (f"{chance.uniform(0.0, 10.0):.1f}@{chance.randrange(360)}",))
    ]
    chance.shuffle(events)
    return RandomFlight(
        *(seed, vehicle, feedback, wind, turbulence, params, may_fall, chance.uniform(3.0, 12.0), 25.0, events)
    )


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
    instance = float(chance.randint(1, faults.MOTORS if row.unit == faults.MOTOR else 1))
    return RandomEvent(after_s, "inject", (faults.unit_name(row.unit), faults.kind_name(row.kind), instance, *values))


def _value(chance: random.Random, parameter: Parameter) -> Value:
    if parameter.values:
        return chance.choice(parameter.values)[0]
    low, high = max(parameter.minimum, -1e3), min(parameter.maximum, 1e3)
    drawn = parameter.default * 2.0 ** chance.uniform(-2.0, 2.0) if parameter.default else chance.uniform(low, high)
    drawn = min(max(drawn, low), high)
    return round(drawn) if parameter.kind is ParamType.INT else drawn


_SAID = (", terminate", ", at an unknown speed")
MAX_IMPACT_M_S = 4.0  # the vehicle reports 3 m/s, by its estimate
MAX_TILT_DEG = 75.0
AIRBORNE_M, NEAR_GROUND_M, TOUCHING_M = 1.0, 0.15, 0.03
GRAZE_S, GRAZE_M_S = 0.5, 2.0  # a contact from which the vehicle flies on in this time, changed by less, is no impact
AFTER_S = 5.0
LAND_WITHIN_S = 150.0


class RandomFlightOutcome(NamedTuple):
    violated: str  # the condition, or empty
    frames_s: list[float]  # work of the autopilot in each frame
    flown_s: float
    texts: list[str]  # with their times


def fly(case: RandomFlight) -> RandomFlightOutcome:
    named = {name: getattr(case, name) for name in ("vehicle", "feedback", "wind", "seed")}
    turbulence = {"turbulence": case.turbulence} if case.turbulence else {}
    with Flights(setting_of([named, turbulence]), None) as flights:
        flown = _JudgedFlight(flights.begin(), case)
        violated = flown.judged()
        texts = [f"{time_s:.2f} s: {text}" for time_s, text in flown.flight.timed_texts]
        return RandomFlightOutcome(violated, flown.frames_s, flown.flight.time_s, texts)


class _JudgedFlight:
    def __init__(self, flight: Sitl, case: RandomFlight) -> None:
        self.flight, self._case = flight, case
        self.frames_s = FrameTimes(flight.inside.autopilot)
        self._feed: Callable[[], object] = _nothing
        self._frames = 0
        self._impact = self._breach = ""
        self._contact: tuple[float, Vector] | None = None
        self._limit_m: float | None = None  # of the distance from home, while outside the fence
        self._keeps_fence = False
        self._braking_m_s2 = self._reaction_s = 0.0

    def judged(self) -> str:
        """Return the violated condition, or nothing."""
        step, self.flight.step = self.flight.step, self._step  # type: ignore[method-assign]
        self._plain_step = step
        try:
            end = self._fly()
        except Exception as error:
            place = extract_tb(error.__traceback__)[-1]
            at = f"{Path(place.filename).name}:{place.lineno}"
            return f"{type(error).__name__} at {at}, t = {self.flight.time_s:.2f} s: {error}"
        return self._unsaid() or self._breach or end

    def _unsaid(self) -> str:
        if not self._impact:
            return ""
        if self._case.lands:
            return f"{self._impact}, though at most one sensor had failed"
        said = any(text.startswith("Impact") or text.endswith(_SAID) for text in self.flight.texts)
        return "" if said else f"{self._impact}, unsaid"

    def _fly(self) -> str:
        flight, case = self.flight, self._case
        for name, value in case.params.items():
            _try(lambda name=name, value=value: flight.set_param(name, value))  # type: ignore[misc]
        _try(lambda: flight.upload_fence(items.circle(case.radius_m)))
        plan = ((12.0, 0.0), (0.0, 12.0), (-8.0, -8.0))
        _try(lambda: flight.upload_mission(items.waypoint(east, north, case.height_m) for east, north in plan))
        if not _try(lambda: flight.takeoff(case.height_m, wait=False)):
            return ""
        is_well = all(event.what not in ("inject", "silence") for event in case.events)
        self._keeps_fence = is_well and flight.get_param("GF_ACTION") not in (0, 1)
        self._braking_m_s2 = flight.get_param("MPC_ACC_HOR")
        self._reaction_s = 0.5 + self._braking_m_s2 / flight.get_param("MPC_JERK_MAX")
        for event in case.events:
            self.flight.run(event.after_s)
            self._limit_m = self._limit_m and inf  # a pilot may fly on outside
            self._happen(event)
        self.flight.run(AFTER_S)
        return self._come_down()

    def _happen(self, event: RandomEvent) -> None:
        flight, values = self.flight, event.values
        numbers = [value for value in values if isinstance(value, float)]
        if event.what == "wind":
            flight.wind = str(values[0])
        elif event.what == "inject":
            unit, kind, *_ = map(str, values)
            _try(lambda: flight.inject(unit, kind, int(numbers[0]), *numbers[1:]))
        elif event.what == "silence":
            flight.gcs.silent = True
            self.flight.run(numbers[0])
            flight.gcs.silent = False
        elif event.what == "goto":
            east, north, up = numbers
            _try(lambda: flight.goto(east, north, up, wait=False))
        elif event.what == "fly":
            _try(lambda: flight.fly_track(str(values[0])))
        else:
            self._select(Mode(event.what), *numbers)

    def _select(self, mode: Mode, x: float, y: float) -> None:
        flight = self.flight
        if mode in MANUAL:
            self._feed = lambda: flight.stick(pitch=x, roll=y)
        elif mode is Mode.OFFBOARD:
            self._feed = lambda: flight.setpoint(velocity=(4.0 * x, 4.0 * y, 0.0))
        else:
            self._feed = _nothing
        self.flight.run(0.2)
        _try(lambda: flight.select(mode))

    def _come_down(self) -> str:
        flight = self.flight
        self._feed = _nothing
        until_s = flight.time_s + LAND_WITHIN_S
        if flight.armed:
            _try(lambda: flight.select(Mode.LAND))
        while flight.armed and flight.time_s < until_s:
            self.flight.run(1.0)
        if self._case.lands and flight.tilt_deg > MAX_TILT_DEG:
            return "overturned, though at most one sensor had failed"
        return f"armed {LAND_WITHIN_S:g} s after mode land" if flight.armed else ""

    def _step(self) -> None:
        flight, self._frames = self.flight, self._frames + 1
        if self._frames % 4 == 0:
            self._feed()
        armed, before_m = flight.armed, flight.position[2]
        velocity, speed_m_s, tilt_deg = flight.velocity, flight.speed_m_s, flight.tilt_deg
        self._plain_step()
        _, _, z = flight.position
        hits = before_m > TOUCHING_M >= z and speed_m_s > MAX_IMPACT_M_S
        if hits or (before_m > NEAR_GROUND_M >= z and tilt_deg > MAX_TILT_DEG):
            self._impact = f"impact at {speed_m_s:.1f} m/s, {tilt_deg:.0f} degrees, t = {flight.time_s:.2f} s"
            self._contact = (flight.time_s, velocity) if tilt_deg <= MAX_TILT_DEG else None
        elif self._contact and flight.time_s > self._contact[0] + GRAZE_S:
            if z > TOUCHING_M and dist(flight.velocity, self._contact[1]) < GRAZE_M_S:
                self._impact = ""
            self._contact = None
        if armed and not flight.armed and z > AIRBORNE_M:
            self._impact = f"rotors stopped at {z:.1f} m, t = {flight.time_s:.2f} s"
        if self._keeps_fence and not self._breach:
            self._check_fence()

    def _check_fence(self) -> None:
        flight = self.flight
        (x, y, _), (vx, vy, _) = flight.position, flight.velocity
        away_m = hypot(x, y)
        if away_m < self._case.radius_m:
            self._limit_m = None
        elif self._limit_m is None:
            out_m_s = max((x * vx + y * vy) / away_m, 0.0)
            braking_m = out_m_s * self._reaction_s + 0.5 * out_m_s**2 / (0.7 * self._braking_m_s2)
            self._limit_m = away_m + braking_m + flight.near_m + 1.0
        elif away_m > self._limit_m:
            self._breach = f"{away_m:.1f} m from home, beyond a fence of {self._case.radius_m:g} m and its braking"


def _try(act: Callable[[], object]) -> bool:
    """Do what the vehicle may refuse, or not hear."""
    try:
        act()
    except (RefusedError, NotInTimeError):
        return False
    return True


def _nothing() -> None: ...


MAX_FRAME_MS = 20.0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.random_flights", description=__doc__)
    parser.add_argument("--seeds", type=seeds, default=seeds("1-500"), metavar="A[-B]", help="default 1-500")
    parser.add_argument("--verbose", action="store_true", help="print what happens in each flight")
    args = parser.parse_args()
    use_one_thread()
    began_s, flown_s, worst_ms, failed = perf_counter(), 0.0, 0.0, 0
    for seed in args.seeds:
        case = case_of(seed)
        verdict, frame_ms = _flown(case)
        flown_s, worst_ms = flown_s + verdict.flown_s, max(worst_ms, frame_ms)
        violated = verdict.violated or (f"a frame of {frame_ms:.1f} ms" if frame_ms > MAX_FRAME_MS else "")
        if args.verbose:
            print(f"seed {seed}: {case}", *verdict.texts, sep="\n", flush=True)
        if violated:
            failed += 1
            print(f"FAILED: {violated}; repeat: python -m tools.random_flights --verbose --seeds {seed}", flush=True)
    flights = f"{len(args.seeds)} flights, {failed} failed; {flown_s:.0f} s flown in {perf_counter() - began_s:.0f} s"
    print(f"{flights}; longest frame {worst_ms:.1f} ms of work")
    return 1 if failed else 0


def _flown(case: RandomFlight) -> tuple[RandomFlightOutcome, float]:
    """Return a flight and its longest frame, ms, of two flights if it seems too long."""
    with loading():
        verdict = fly(case)
        frames_s = verdict.frames_s
        if max(frames_s, default=0.0) * 1e3 > MAX_FRAME_MS:
            frames_s = list(map(min, frames_s, fly(case).frames_s))
    return verdict, max(frames_s, default=0.0) * 1e3


if __name__ == "__main__":
    sys.exit(main())
