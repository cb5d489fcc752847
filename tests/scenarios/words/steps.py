"""What is done in a scenario, and what must hold: the words that scenarios are written in."""

from collections.abc import Callable, Sequence
from math import dist, inf, nan, radians
from operator import methodcaller
from typing import Any

import numpy as np
import pytest

from colibri.common.types import Array, Vector
from colibri.sitl.flight_record import Columns, tilt_deg
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words.conditions import Condition
from tests.scenarios.words.scenario import Step


def _order(method: str) -> Callable[..., Step]:
    """Return what makes a step of an order of the vehicle."""
    return lambda *given, **options: methodcaller(method, *given, **options)


def _nothing(_: Sitl) -> None:
    """Only fly on."""


run, arm, disarm, takeoff, land, select = map(_order, ("run", "arm", "disarm", "takeoff", "land", "select"))
put, upload, upload_fence, inject = map(_order, ("set_param", "upload_mission", "upload_fence", "inject"))
start_mission, kill_autopilot = methodcaller("start_mission"), methodcaller("kill_autopilot")


def goto(place: Vector, *, yaw_deg: float = nan, speed: float = -1.0, wait: bool = True) -> Step:
    return lambda sitl: sitl.goto(*place, yaw=radians(yaw_deg), speed=speed, wait=wait)


def command(number: int, *params: float, result: int) -> Step:
    def step(sitl: Sitl) -> None:
        got = sitl.command(number, *params)
        assert got == result, f"command {number} had result {got}, not {result}: {sitl}"

    return step


def refused(step: Step, because: str) -> Step:
    def attempt(sitl: Sitl) -> None:
        before = len(sitl.texts)
        with pytest.raises(RefusedError) as refusal:
            step(sitl)
        assert because in f"{refusal.value} {sitl.texts[before:]}"

    return attempt


def until(condition: Condition, *, within: float, meanwhile: Step = _nothing) -> Step:
    return lambda sitl: sitl.wait_until(_beside(meanwhile, condition, sitl), within=within, what=condition.words)


def hold(condition: Condition, *, for_: float, meanwhile: Step = _nothing) -> Step:
    return lambda sitl: sitl.hold(_beside(meanwhile, condition, sitl), for_=for_, what=condition.words)


def _beside(step: Step, condition: Condition, sitl: Sitl) -> Callable[[], bool]:
    def holds() -> bool:
        step(sitl)
        return condition.holds(sitl)

    return holds


def moves_less(max_m: float, seconds: float, tilt: float = 90.0) -> Step:
    def step(sitl: Sitl) -> None:
        began = sitl.position
        near_and_level = lambda: dist(sitl.position, began) <= max_m and sitl.tilt_deg <= tilt  # noqa: E731
        sitl.hold(near_and_level, for_=seconds, what=f"at most {max_m:g} m away")

    return step


def check(condition: Condition) -> Step:
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
    return at_every(0.02, lambda sitl: sitl.setpoint(**what))


def trouble(link: str, **what: float | bool) -> Step:
    def step(sitl: Sitl) -> None:
        for name, value in what.items():
            setattr(getattr(sitl.link, link), name, value)

    return step


def silence(*, still: bool = True) -> Step:
    def step(sitl: Sitl) -> None:
        sitl.gcs.silent = still

    return step


def measured(
    words: str, of: Callable[[Columns], float], maximum: float, *, minimum: float = -inf, last_s: float | None = None
) -> Step:
    """See that a figure of what was flown, or of the last seconds of it, is within bounds."""

    def step(sitl: Sitl) -> None:
        columns = sitl.flown(0.0 if last_s is None else sitl.time_s - last_s)
        figure = of(columns)
        assert minimum <= figure <= maximum, f"{words} is {figure:.4g}, not {minimum:g} to {maximum:g}: {sitl}"

    return step


def then(*steps: Step) -> Step:
    def step(sitl: Sitl) -> None:
        for each in steps:
            each(sitl)

    return step


def places(columns: Columns) -> Array:
    return np.stack([columns["x"], columns["y"], columns["z"]], axis=1)


def max_distance_from(place: Sequence[float]) -> Callable[[Columns], float]:
    return lambda columns: float(np.linalg.norm(places(columns) - place, axis=1).max())


def highest(columns: Columns) -> float:
    return float(columns["z"].max())


def max_tilt(columns: Columns) -> float:
    return float(tilt_deg(columns).max())
