"""What is done in a scenario, and what must hold: the words that scenarios are written in."""

from collections.abc import Callable, Iterable, Sequence
from math import dist, nan, radians
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.types import Array, Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.parameters.store import Value
from colibri.sitl.flight_record import Columns, tilt_deg
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.mission_items import Item
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words.conditions import Condition
from tests.scenarios.words.scenario import Step


def run(seconds: float) -> Step:
    """Let time pass."""
    return lambda sitl: sitl.run(seconds)


def arm(*, force: bool = False) -> Step:
    """Arm."""
    return lambda sitl: sitl.arm(force=force)


def disarm(*, force: bool = False) -> Step:
    """Disarm."""
    return lambda sitl: sitl.disarm(force=force)


def takeoff(height_m: float, *, wait: bool = True) -> Step:
    """Take off."""
    return lambda sitl: sitl.takeoff(height_m, wait=wait)


def land(*, wait: bool = True) -> Step:
    """Land."""
    return lambda sitl: sitl.land(wait=wait)


def goto(place: Vector, *, yaw_deg: float = nan, speed: float = -1.0, wait: bool = True) -> Step:
    """Fly to a place."""
    return lambda sitl: sitl.goto(*place, yaw=radians(yaw_deg), speed=speed, wait=wait)


def select(mode: Mode) -> Step:
    """Choose a mode."""
    return lambda sitl: sitl.select(mode)


def put(name: str, value: Value) -> Step:
    """Set a parameter."""
    return lambda sitl: sitl.set_param(name, value)


def upload(items: Iterable[Item | MissionItem]) -> Step:
    """Upload a mission."""
    return lambda sitl: sitl.upload_mission(items)


def upload_fence(items: Iterable[Item | MissionItem]) -> Step:
    """Upload a geofence."""
    return lambda sitl: sitl.upload_fence(items)


def start_mission(sitl: Sitl) -> None:
    """Fly the mission."""
    sitl.start_mission()


def command(number: int, *params: float, result: int) -> Step:
    """Send a command that has that MAV_RESULT."""

    def step(sitl: Sitl) -> None:
        got = sitl.command(number, *params)
        assert got == result, f"command {number} had result {got}, not {result}: {sitl}"

    return step


def refused(step: Step, because: str) -> Step:
    """Try what is refused, with a reason that says so."""

    def attempt(sitl: Sitl) -> None:
        before = len(sitl.texts)
        with pytest.raises(RefusedError) as refusal:
            step(sitl)
        assert because in f"{refusal.value} {sitl.texts[before:]}"

    return attempt


def until(condition: Condition, *, within: float, meanwhile: Step | None = None) -> Step:
    """Fly until a condition holds; do something at each frame before."""

    def step(sitl: Sitl) -> None:
        def there() -> bool:
            if meanwhile is not None:
                meanwhile(sitl)
            return condition.holds(sitl)

        sitl.wait_until(there, within=within, what=condition.words)

    return step


def hold(condition: Condition, *, for_: float, meanwhile: Step | None = None) -> Step:
    """Fly on, and see the condition hold at each frame; do something at each frame before."""

    def step(sitl: Sitl) -> None:
        def still() -> bool:
            if meanwhile is not None:
                meanwhile(sitl)
            return condition.holds(sitl)

        sitl.hold(still, for_=for_, what=condition.words)

    return step


def moves_less(max_m: float, seconds: float, tilt: float = 90.0) -> Step:
    """See that it stays about where it is."""

    def step(sitl: Sitl) -> None:
        began = sitl.position
        near_and_level = lambda: dist(sitl.position, began) <= max_m and sitl.tilt_deg <= tilt  # noqa: E731
        sitl.hold(near_and_level, for_=seconds, what=f"at most {max_m:g} m away")

    return step


def check(condition: Condition) -> Step:
    """See that a condition holds now."""

    def step(sitl: Sitl) -> None:
        assert condition.holds(sitl), f"not so: {condition.words}: {sitl}"

    return step


def at_every(seconds: float, step: Step) -> Step:
    """Do something so often; to be used beside `until` and `hold`."""

    def now_and_then(sitl: Sitl) -> None:
        if sitl.time_us % round(seconds * 1e6) == 0:
            step(sitl)

    return now_and_then


def by_hand(step: Step, **axes: float) -> Step:
    """Do something while the sticks are held: see `Sitl.stick`."""

    def held(sitl: Sitl) -> None:
        with sitl.sticks_held(**axes):
            step(sitl)

    return held


def setpoint(**what: Any) -> Step:
    """Send a setpoint, twenty times a second."""
    return at_every(0.02, lambda sitl: sitl.setpoint(**what))


def inject(unit: str, kind: str, instance: int = 0, *values: float) -> Step:
    """Have the plant fail."""
    return lambda sitl: sitl.inject(unit, kind, instance, *values)


def trouble(link: str, **what: float | bool) -> Step:
    """Have a link, "ground" or "plant", do something from now on."""

    def step(sitl: Sitl) -> None:
        for name, value in what.items():
            setattr(getattr(sitl.link, link), name, value)

    return step


def silence(*, still: bool = True) -> Step:
    """Have the ground station say nothing any more, or talk again."""

    def step(sitl: Sitl) -> None:
        sitl.gcs.silent = still

    return step


def measured(words: str, of: Callable[[Columns], float], maximum: float, *, last_s: float | None = None) -> Step:
    """See that a figure of what was flown, or of the last seconds of it, is at most so much."""

    def step(sitl: Sitl) -> None:
        columns = sitl.flown(0.0 if last_s is None else sitl.time_s - last_s)
        figure = of(columns)
        assert figure <= maximum, f"{words} is {figure:.4g}, more than {maximum:g}: {sitl}"

    return step


def then(*steps: Step) -> Step:
    """Do several things."""

    def step(sitl: Sitl) -> None:
        for each in steps:
            each(sitl)

    return step


def places(columns: Columns) -> Array:
    """Return where it was, ENU, (n, 3)."""
    return np.stack([columns["x"], columns["y"], columns["z"]], axis=1)


def max_distance_from(place: Sequence[float]) -> Callable[[Columns], float]:
    """Return the figure: how far it was from a place at most."""
    return lambda columns: float(np.linalg.norm(places(columns) - place, axis=1).max())


def highest(columns: Columns) -> float:
    """Return the figure: how high it was at most."""
    return float(columns["z"].max())


def max_tilt(columns: Columns) -> float:
    """Return the figure: the largest tilt, degrees."""
    return float(tilt_deg(columns).max())
