"""Flights in which sensors fail, on to the ground: `python -m tests.support.failed_sensors` flies a matrix of them."""

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

from msgspec.structs import replace

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl

SENSORS = ("accel", "gyro", "baro", "mag", "gps")
KINDS = ("off", "stuck", "garbage", "slow", "delayed")
WINDS = (0.0, 5.0, 10.0)
MAX_IMPACT_M_S, MAX_IMPACT_DEG = 3.0, 60.0
_HEIGHT_M, _NEAR_GROUND_M = 8.0, 0.1
_WATCHED_S, _LAND_WITHIN_S = 20.0, 60.0


class Fault(NamedTuple):
    unit: str
    kind: str
    values: tuple[float, ...] = ()

    def __str__(self) -> str:
        return " ".join((self.unit, self.kind, *map(str, self.values)))


class Outcome(NamedTuple):
    """The end of a flight: speed and tilt at the first contact, and the time to disarm after it; None: never."""

    impact_m_s: float | None
    tilt_deg: float
    disarmed_s: float | None
    in_the_air: bool
    highest_m: float
    texts: Sequence[str]

    @property
    def bad(self) -> str:
        if self.in_the_air:
            return "disarmed in the air"
        if self.impact_m_s is None:
            return "never down"
        if self.impact_m_s > MAX_IMPACT_M_S or self.tilt_deg > MAX_IMPACT_DEG:
            return "impact"
        return "armed on the ground" if self.disarmed_s is None else ""


@contextmanager
def airborne(wind_m_s: float, seed: int, vehicle: str) -> Iterator[Sitl]:
    profile = load_profile("flight")
    profile = replace(profile, simulation=replace(profile.simulation, frame_interval_s=None))
    setting = {"feedback": "sensors", "seed": seed, "profile": profile, "wind": f"{wind_m_s:g}@270", "strict": False}
    with Flights(setting_of([setting, {"vehicle": vehicle}]), None) as flights:
        flight = flights.begin()
        flight.takeoff(_HEIGHT_M)
        yield flight


def hover(flight: Sitl) -> None:
    flight.run(1.0)


def cruise(flight: Sitl) -> None:
    flight.goto(60.0, 20.0, _HEIGHT_M, wait=False)
    flight.run(4.0)


def landing(flight: Sitl) -> None:
    flight.select(Mode.LAND)
    flight.run(2.0)


SITUATIONS: dict[str, Callable[[Sitl], None]] = {each.__name__: each for each in (hover, cruise, landing)}


def flown_on(flight: Sitl, faults: Sequence[Fault], *, watched_s: float = _WATCHED_S) -> Outcome:
    """Inject faults, land after a while, and fly on to the ground."""
    flight.gcs.forget()
    for fault in faults:
        flight.inject(fault.unit, fault.kind, 0, *fault.values)
    land_s, highest_m = flight.time_s + watched_s, 0.0
    contact: tuple[float, float, float] | None = None
    while flight.armed and flight.time_s < (land_s + _LAND_WITHIN_S if contact is None else contact[0] + 30.0):
        if contact is None and land_s < flight.time_s and flight.mode is not Mode.LAND:
            with suppress(RefusedError):
                flight.select(Mode.LAND)
            land_s = flight.time_s + 5.0
        flight.step()
        highest_m = max(highest_m, flight.position[2])
        if contact is None and flight.position[2] < _NEAR_GROUND_M:
            contact = (flight.time_s, flight.speed_m_s, flight.tilt_deg)
    in_the_air = not flight.armed and contact is None
    began_s, impact_m_s, tilt_deg = contact or (None, None, 0.0)
    disarmed_s = None if flight.armed or began_s is None else flight.time_s - began_s
    return Outcome(impact_m_s, tilt_deg, disarmed_s, in_the_air, highest_m, list(flight.gcs.texts))


def matrix(
    cases: Sequence[Sequence[Fault]],
    winds: Sequence[float] = WINDS,
    situations: Sequence[str] = tuple(SITUATIONS),
    *,
    seed: int = 1,
    vehicle: str = "hummingbird",
) -> Iterator[tuple[str, Outcome]]:
    """Fly all cases in all winds and situations, each in a fork; yield its name and outcome."""
    for wind_m_s in winds:
        with airborne(wind_m_s, seed, vehicle) as flight:
            for situation in situations:
                for case, fields in _in_forks(flight, situation, cases):
                    yield f"{wind_m_s:g} m/s, {situation}, {case}", Outcome(*fields)


def _in_forks(flight: Sitl, situation: str, cases: Sequence[Sequence[Fault]]) -> list[tuple[str, list[Any]]]:
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        SITUATIONS[situation](flight)
        for case in cases:
            child = os.fork()
            if child == 0:
                line = json.dumps((" + ".join(map(str, case)), flown_on(flight, case)))
                os.write(writing, f"{line}\n".encode())
                os._exit(0)
            os.waitpid(child, 0)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as lines:
        found = [json.loads(line) for line in lines]
    os.waitpid(pid, 0)
    return found


def singles() -> list[tuple[Fault, ...]]:
    return [(Fault(unit, kind),) for unit in SENSORS for kind in KINDS]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="only faults with this in their name")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--vehicle", default="hummingbird")
    args = parser.parse_args()
    cases = [case for case in singles() if args.only in str(case[0])]
    counts: Counter[str] = Counter()
    for name, outcome in matrix(cases, seed=args.seed, vehicle=args.vehicle):
        counts[outcome.bad or "well"] += 1
        if outcome.bad:
            sys.stdout.write(f"{outcome.bad}: {name}: {outcome}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{dict(counts)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
