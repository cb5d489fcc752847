"""`python -m tools.vehicles FOLDER`: whether a law flies every vehicle of a folder.

Flights start in hover 2 m off the track. Lemniscates require 60 % of the vehicle's acceleration. A flight is lost if
it ends 2 m from its reference or more, upside down, or on the ground.
"""

import sys
from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.errors import Error
from colibri.common.process.lifecycle import gc_frozen
from colibri.conformance.vehicle_flights import (
    FAR_M,
    HEIGHT_M,
    HOVER,
    OFF_M,
    acceleration_m_s2,
    lemniscate,
)
from colibri.flights.flight import Direct, SteppedFlight
from colibri.flights.in_process import put_together
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import RotorLag, Vehicle, load_vehicle

REJOINED_FROM_M = 5.0


class Outcome(NamedTuple):
    lost: str  # empty: not lost
    rms_m: float  # over the last third
    rate_rad_s: float  # largest body rate over the last third: a limit cycle


class Trial(NamedTuple):
    """A kind of flight: track and options for a vehicle."""

    options: Callable[[Vehicle], dict[str, Any]]
    duration_s: float
    off_m: float = OFF_M
    assumed: Callable[[Vehicle], Vehicle] = lambda vehicle: vehicle  # the vehicle that the law assumes


def circle(speed_m_s: float) -> Callable[[Vehicle], dict[str, Any]]:
    def options(vehicle: Vehicle) -> dict[str, Any]:
        radius_m = max(speed_m_s * speed_m_s / (0.3 * acceleration_m_s2(vehicle)), 8.0)
        return {"track": f"circle:radius={radius_m:.1f},speed={speed_m_s:g},height={HEIGHT_M:g}"}

    return options


def lagging(factor: float) -> Callable[[Vehicle], Vehicle]:
    def assumed(vehicle: Vehicle) -> Vehicle:
        lag = vehicle.rotors.lag
        if lag is None or factor == 0.0:
            return vehicle.without(["rotor-lag"])
        times = (max(factor * time, 0.001) for time in (lag.time_constant_up_s, lag.time_constant_down_s))
        return vehicle.replace("rotors.lag", RotorLag(**dict(zip(lag.__struct_fields__, times, strict=True))))

    return assumed


def loaded(vehicle: Vehicle) -> dict[str, Any]:
    return {
        "track": HOVER,
        "plant_vehicle": vehicle.replace("body.mass_kg", 1.2 * vehicle.body.mass_kg),
        "wind": "5@270",
    }


HOVERING = {"track": HOVER}
TRIALS = {
    "hover": Trial(lambda _: HOVERING, 6.0),
    "spiral": Trial(lambda _: {"track": "spiral"}, 6.0),
    "lemniscate": Trial(lambda vehicle: {"track": lemniscate(vehicle)}, 12.0),
    "loaded": Trial(loaded, 14.0),
    "sensors": Trial(lambda _: {"track": "hover:height=3", "feedback": "sensors"}, 14.0, 0.0),
    "weak": Trial(lambda v: HOVERING | {"plant_vehicle": v.replace("rotors.strength", (0.85, 1.0, 1.0, 1.0))}, 9.0),
    "at 5 m/s": Trial(circle(5.0), 30.0, REJOINED_FROM_M),
    "at 8 m/s": Trial(circle(8.0), 30.0, REJOINED_FROM_M),
    "at 12 m/s": Trial(circle(12.0), 45.0, REJOINED_FROM_M),
    "no lag": Trial(lambda v: HOVERING | {"plant_vehicle": lagging(0.0)(v)}, 6.0, OFF_M, lagging(0.0)),
    "half the lag: hover": Trial(lambda v: HOVERING | {"plant_vehicle": v}, 8.0, OFF_M, lagging(0.5)),
    "half the lag": Trial(lambda v: {"track": lemniscate(v), "plant_vehicle": v}, 12.0, OFF_M, lagging(0.5)),
    "lag unknown": Trial(lambda v: HOVERING | {"plant_vehicle": v}, 8.0, OFF_M, lagging(0.0)),
}


def fly(vehicle: Vehicle, trial: Trial, profile: Any = "flight", controller: str | None = None) -> Outcome:
    try:
        return _flown(vehicle, trial, profile, controller)
    except Error as error:
        return Outcome(f"{error}"[:60], np.inf, np.inf)


def _flown(vehicle: Vehicle, trial: Trial, profile: Any, controller: str | None) -> Outcome:
    options: dict[str, Any] = {"profile": profile, "controller": controller, "vehicle": trial.assumed(vehicle)}
    options |= {"link": "direct", **trial.options(vehicle)}
    plan = FlightPlan.of(FlightSpec.of(**options))
    if trial.off_m:
        x, y, z = position(plan.track, np.zeros(1))[0]
        flown = plan.plant_vehicle if plan.spec.plant_vehicle is None else vehicle
        start = {"x": x, "y": y - trial.off_m, "z": z, "rotors": flown.hover_rpm}
        plan = FlightPlan.of(FlightSpec.of(**options, start=start))
    autopilot, plant = put_together(plan, lambda: 0.0)
    with gc_frozen():
        samples = SteppedFlight(plant, autopilot, Direct()).samples(trial.duration_s)
        flight = np.array([(sample.world.time_us * 1e-6, *sample.world.state) for sample in samples])
    last = flight[len(flight) * 2 // 3 :]
    errors = np.linalg.norm(last[:, 7:10] - position(plan.track, last[:, 0]), axis=1)
    rms_m, upright = float(np.sqrt((errors * errors).mean())), 1.0 - 2.0 * (last[:, 11] ** 2 + last[:, 12] ** 2).max()
    grounded = bool((last[:, 9] < 0.1).any()) and vehicle.ground is not None
    lost = "ground" if grounded else f"{errors.max():.1f} m" if errors.max() > FAR_M else "over" if upright < 0 else ""
    return Outcome(lost, rms_m, float(np.abs(last[:, 4:7]).max()))


def main() -> int:
    parser = ArgumentParser(prog="python -m tools.vehicles", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--profile", default="flight")
    parser.add_argument("--controller")
    parser.add_argument("--trial", action="append", choices=TRIALS, help="only this one; may be repeated")
    parser.add_argument("--only", action="append", help="only this vehicle; may be repeated")
    args = parser.parse_args()
    names = args.trial or list(TRIALS)
    files = [file for file in sorted(args.folder.glob("*.toml")) if not args.only or file.stem in args.only]
    lost = dict.fromkeys(names, 0)
    _write("vehicle", *names)
    _write(*["---"] * (len(names) + 1))
    for file in files:
        outcomes = [fly(load_vehicle(str(file)), TRIALS[name], args.profile, args.controller) for name in names]
        for name, outcome in zip(names, outcomes, strict=True):
            lost[name] += bool(outcome.lost)
        _write(file.stem, *(f"lost: {it.lost}" if it.lost else f"{it.rms_m:.2g}" for it in outcomes))
    _write(f"lost of {len(files)}", *map(str, lost.values()))
    return int(any(lost.values()))


def _write(*cells: str) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
