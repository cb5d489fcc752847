"""Families of flights: the same track from starts a millimetre apart, so that no verdict hangs on one trajectory.

`python -m tests.flights.family`: a table of tilts and distances on lemniscates that no vehicle can follow.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.core import Autopilot
from autopilot.tracks import position
from mavlink.geodesy import DEFAULT_ORIGIN
from mavlink.process import undisturbed
from plant.core import Plant
from plant.scenario import Start, nudged
from plant.world import Physics, starting_world
from tools.local import Direct
from tools.plan import FlightPlan

APART_M = 1e-3
LAPS_S = (4.0, 3.0, 2.0, 1.0)
STARTS = 50
DURATION_S = 40.0
CAUGHT_UP_S = 4.0
"""The start, 1 m below and beside the track, no longer counts."""


class Extremes(NamedTuple):
    """The worst of one flight.

    Attributes:
        max_tilt_deg: Of the body's z axis from the vertical, from the start on.
        max_error_m: Distance to the reference of the same instant, once caught up.
        min_z_m: Height, from the start on.
        max_z_m: Height, from the start on.
        fallbacks: Control samples that something other than a plan decided.
    """

    max_tilt_deg: float
    max_error_m: float
    min_z_m: float
    max_z_m: float
    fallbacks: int


def starts(start: Start, count: int) -> Iterator[Start]:
    """Return `count` starts: `start`, and others a millimetre from it in every direction."""
    rng = np.random.default_rng(1)
    yield start
    for _ in range(count - 1):
        x, y, z = rng.normal(size=3)
        scale = APART_M / np.sqrt(x * x + y * y + z * z)
        yield start._replace(x=start.x + scale * x, y=start.y + scale * y, z=start.z + scale * z)


def fly_family(track: str, count: int, duration_s: float) -> list[Extremes]:
    """Fly profile `flight` from each of `count` starts."""
    plan = FlightPlan.of_track(track, Path(), profile="flight")
    return [_fly(plan, start, duration_s) for start in starts(plan.start, count)]


def _fly(plan: FlightPlan, start: Start, duration_s: float) -> Extremes:
    autopilot = Autopilot(plan.profile, plan.vehicle, plan.track, lambda: 0.0)
    plant = Plant(
        starting_world(nudged(start), plan.plant_vehicle),
        plan.plant_vehicle,
        Physics(plan.plant_vehicle, "rk4"),
        plan.feedback,
        DEFAULT_ORIGIN,
        seed=0,
        interval_us=autopilot.frame_interval_us,
    )
    exchange, states, fallbacks = Direct(autopilot), [], 0
    with undisturbed():
        while plant.world.time_us < duration_s * 1e6:
            step, command = exchange(plant)
            fallbacks += step.decision is not None and step.decision.diagnostics.fallback is not None
            plant.answer(command)
            states.append((plant.world.time_us * 1e-6, *plant.world.state))
    return _extremes(plan, np.array(states), fallbacks)


def _extremes(plan: FlightPlan, states: NDArray[np.float64], fallbacks: int) -> Extremes:
    """Return the worst of time and state, (n, 14)."""
    t, places, (_, q1, q2, _) = states[:, 0], states[:, 7:10], states[:, 10:14].T
    tilt = np.arccos(np.clip(1.0 - 2.0 * (q1 * q1 + q2 * q2), -1.0, 1.0))
    late = t > CAUGHT_UP_S
    errors = np.linalg.norm(places[late] - position(plan.track, t[late]), axis=1)
    z = places[:, 2]
    return Extremes(float(np.degrees(tilt.max())), float(errors.max()), float(z.min()), float(z.max()), fallbacks)


def main() -> None:
    """Print the table."""
    print("| lap (s) | tilt: largest (deg) | median | distance: largest (m) | height (m) | fallback samples |")  # noqa: T201
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")  # noqa: T201
    for lap_s in LAPS_S:
        flown = fly_family(f"lemniscate:lap={lap_s}", STARTS, DURATION_S)
        tilts = [it.max_tilt_deg for it in flown]
        heights = f"{min(it.min_z_m for it in flown):.2f} to {max(it.max_z_m for it in flown):.2f}"
        error_m, fallbacks = max(it.max_error_m for it in flown), max(it.fallbacks for it in flown)
        print(f"| {lap_s:g} | {max(tilts):.1f} | {np.median(tilts):.1f} | {error_m:.2f} | {heights} | {fallbacks} |")  # noqa: T201


if __name__ == "__main__":
    main()
