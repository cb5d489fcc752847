"""Families of flights: the same track from starts a millimetre apart, so that no verdict hangs on one trajectory.

`python -m tests.support.family`: a table of tilts and distances on lemniscates that no vehicle can follow.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.process.lifecycle import gc_frozen
from colibri.common.types import Array
from colibri.flights.flight import Direct, SteppedFlight
from colibri.flights.in_process import put_together
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.plant.physics.start import Start

APART_M = 1e-3
LAPS_S = (4.0, 3.0, 2.0, 1.0)
STARTS = 50
DURATION_S = 40.0
CAUGHT_UP_S = 4.0  # the start, 1 m below and beside the track, no longer counts


class Flown(NamedTuple):
    """A flight, one value a frame, (n,)."""

    t: Array
    tilt_deg: Array  # of the body's z axis from the vertical
    error_m: Array  # distance to the reference of the same instant
    z_m: Array
    fallback: NDArray[np.bool_]  # something other than a plan decided


def starts(start: Start, count: int) -> Iterator[Start]:
    """Return `count` starts: `start`, and others a millimetre from it in every direction."""
    rng = np.random.default_rng(1)
    yield start
    for _ in range(count - 1):
        x, y, z = rng.normal(size=3)
        scale = APART_M / np.sqrt(x * x + y * y + z * z)
        yield start._replace(x=start.x + scale * x, y=start.y + scale * y, z=start.z + scale * z)


def fly_family(track: str, count: int, duration_s: float, **start: float) -> list[Flown]:
    """Fly profile `flight` from each of `count` starts; `start` as in `Start`, in place of the profile's."""
    plan = FlightPlan.of(FlightSpec.of(track, link="direct", start=start))
    return [_fly(plan, it, duration_s) for it in starts(plan.start, count)]


def _fly(plan: FlightPlan, start: Start, duration_s: float) -> Flown:
    autopilot, plant = put_together(replace(plan, start=start), lambda: 0.0)
    states, fallback = [], []
    with gc_frozen():
        for sample in SteppedFlight(plant, autopilot, Direct()).samples(duration_s):
            states.append((sample.world.time_us * 1e-6, *sample.world.state))
            decision = sample.step.decision
            fallback.append(decision is not None and decision.diagnostics.fallback is not None)
    return _flown(plan, np.array(states), np.array(fallback))


def _flown(plan: FlightPlan, states: Array, fallback: NDArray[np.bool_]) -> Flown:
    t, places, (_, q1, q2, _) = states[:, 0], states[:, 7:10], states[:, 10:14].T
    tilt = np.arccos(np.clip(1.0 - 2.0 * (q1 * q1 + q2 * q2), -1.0, 1.0))
    errors = np.linalg.norm(places - position(plan.track, t), axis=1)
    return Flown(t, np.degrees(tilt), errors, places[:, 2], fallback)


def main() -> None:
    print("| lap (s) | tilt: largest (deg) | median of the largest | distance (m) | height (m) | fallback samples |")  # noqa: T201
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")  # noqa: T201
    for lap_s in LAPS_S:
        flown = fly_family(f"lemniscate:lap={lap_s}", STARTS, DURATION_S)
        tilts = [float(it.tilt_deg.max()) for it in flown]
        heights = f"{min(it.z_m.min() for it in flown):.2f} to {max(it.z_m.max() for it in flown):.2f}"
        error_m = max(it.error_m[it.t > CAUGHT_UP_S].max() for it in flown)
        samples = max(it.fallback.sum() for it in flown)
        print(f"| {lap_s:g} | {max(tilts):.1f} | {np.median(tilts):.1f} | {error_m:.2f} | {heights} | {samples} |")  # noqa: T201


if __name__ == "__main__":
    main()
