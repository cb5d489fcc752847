"""`python -m tools.vehicles FOLDER`: whether a law flies every vehicle of a folder.

Flights and their losses are those of `colibri check-vehicle`.
"""

import sys
from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from colibri.conformance.vehicle_flights import HEIGHT_M, HOVER, Flown, Trial, acceleration_m_s2, lemniscate
from colibri.conformance.vehicle_flights import fly as fly_trial
from colibri.plant.vehicle.description import RotorLag, Vehicle, load_vehicle

REJOINED_FROM_M = 5.0


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
    "sensors": Trial(lambda _: {"track": "hover:height=3", "feedback": "sensors"}, 14.0, off_m=0.0),
    "weak": Trial(lambda v: HOVERING | {"plant_vehicle": v.replace("rotors.strength", (0.85, 1.0, 1.0, 1.0))}, 9.0),
    "at 5 m/s": Trial(circle(5.0), 30.0, off_m=REJOINED_FROM_M),
    "at 8 m/s": Trial(circle(8.0), 30.0, off_m=REJOINED_FROM_M),
    "at 12 m/s": Trial(circle(12.0), 45.0, off_m=REJOINED_FROM_M),
    "no lag": Trial(lambda v: HOVERING | {"plant_vehicle": lagging(0.0)(v)}, 6.0),
    "half the lag: hover": Trial(lambda v: HOVERING | {"plant_vehicle": v}, 8.0),
    "half the lag": Trial(lambda v: {"track": lemniscate(v), "plant_vehicle": v}, 12.0),
    "lag unknown": Trial(lambda v: HOVERING | {"plant_vehicle": v}, 8.0),
}
ASSUMED = {
    "no lag": lagging(0.0),
    "half the lag: hover": lagging(0.5),
    "half the lag": lagging(0.5),
    "lag unknown": lagging(0.0),
}
"""Vehicles that the law assumes, where it is another one."""


def fly(vehicle: Vehicle, trial: str, profile: Any = "flight", controller: str | None = None) -> Flown:
    assumed = ASSUMED[trial](vehicle) if trial in ASSUMED else vehicle
    return fly_trial(vehicle, TRIALS[trial], {"profile": profile, "controller": controller}, assumed)


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
        outcomes = [fly(load_vehicle(str(file)), name, args.profile, args.controller) for name in names]
        for name, outcome in zip(names, outcomes, strict=True):
            lost[name] += bool(outcome.lost)
        _write(file.stem, *(it.lost[:60] or f"{it.error_m:.2g}" for it in outcomes))
    _write(f"lost of {len(files)}", *map(str, lost.values()))
    return int(any(lost.values()))


def _write(*cells: str) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
