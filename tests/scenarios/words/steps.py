"""What is done in a scenario, and what must hold: the words that scenarios are written in."""

from collections.abc import Callable, Sequence
from math import dist, inf, nan, radians
from operator import methodcaller
from typing import Any, Concatenate, ParamSpec

import numpy as np
import pytest

from colibri.common.types import Array, Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.sitl.flight_record import Columns, tilt_deg
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.mission_items import Item
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words.conditions import Condition
from tests.scenarios.words.scenario import Step

P = ParamSpec("P")


def word(act: Callable[Concatenate[Sitl, P], object]) -> Callable[P, Step]:
    """Return what makes a step of an act: it takes what is given beside the vehicle."""
    return lambda *given, **options: lambda sitl: act(sitl, *given, **options)


def _order(method: str) -> Callable[..., Step]:
    """Return what makes a step of an order of the vehicle."""
    return lambda *given, **options: methodcaller(method, *given, **options)


def _nothing(_: Sitl) -> None:
    """Only fly on."""


run, arm, disarm, takeoff, land, select = map(_order, ("run", "arm", "disarm", "takeoff", "land", "select"))
put, upload_fence, inject = map(_order, ("set_param", "upload_fence", "inject"))
start_mission, kill_autopilot = methodcaller("start_mission"), methodcaller("kill_autopilot")


def goto(place: Vector, *, yaw_deg: float = nan, speed: float = -1.0, wait: bool = True) -> Step:
    return lambda sitl: sitl.goto(*place, yaw=radians(yaw_deg), speed=speed, wait=wait)


@word
def upload(sitl: Sitl, *plan: Item | MissionItem) -> None:
    sitl.upload_mission(plan)


@word
def command(sitl: Sitl, number: int, *params: float, result: int) -> None:
    got = sitl.command(number, *params)
    assert got == result, f"command {number} had result {got}, not {result}: {sitl}"


@word
def refused(sitl: Sitl, step: Step, because: str) -> None:
    before = len(sitl.texts)
    with pytest.raises(RefusedError) as refusal:
        step(sitl)
    assert because in f"{refusal.value} {sitl.texts[before:]}"


def until(condition: Condition, *, within: float, meanwhile: Step = _nothing) -> Step:
    return lambda sitl: sitl.wait_until(_beside(meanwhile, condition, sitl), within=within, what=condition.words)


def hold(condition: Condition, *, for_: float, meanwhile: Step = _nothing) -> Step:
    return lambda sitl: sitl.hold(_beside(meanwhile, condition, sitl), for_=for_, what=condition.words)


def _beside(step: Step, condition: Condition, sitl: Sitl) -> Callable[[], bool]:
    def holds() -> bool:
        step(sitl)
        return condition.holds(sitl)

    return holds


@word
def moves_less(sitl: Sitl, max_m: float, seconds: float, tilt: float = 90.0) -> None:
    began = sitl.position
    near_and_level = lambda: dist(sitl.position, began) <= max_m and sitl.tilt_deg <= tilt  # noqa: E731
    sitl.hold(near_and_level, for_=seconds, what=f"at most {max_m:g} m away")


@word
def check(sitl: Sitl, condition: Condition) -> None:
    assert condition.holds(sitl), f"not so: {condition.words}: {sitl}"


@word
def at_every(sitl: Sitl, seconds: float, step: Step) -> None:
    """Do something so often; to be used beside `until` and `hold`."""
    if sitl.time_us % round(seconds * 1e6) == 0:
        step(sitl)


@word
def by_hand(sitl: Sitl, /, step: Step, **axes: float) -> None:
    """Do something while the sticks are held: see `Sitl.stick`."""
    with sitl.sticks_held(**axes):
        step(sitl)


def setpoint(**what: Any) -> Step:
    return at_every(0.02, lambda sitl: sitl.setpoint(**what))


@word
def trouble(sitl: Sitl, /, link: str, **what: float | bool) -> None:
    for name, value in what.items():
        setattr(getattr(sitl.link, link), name, value)


@word
def silence(sitl: Sitl, *, still: bool = True) -> None:
    sitl.gcs.silent = still


@word
def measured(
    sitl: Sitl,
    words: str,
    of: Callable[[Columns], float],
    maximum: float,
    *,
    minimum: float = -inf,
    last_s: float | None = None,
) -> None:
    """See that a figure of what was flown, or of the last seconds of it, is within bounds."""
    columns = sitl.flown(0.0 if last_s is None else sitl.time_s - last_s)
    figure = of(columns)
    assert minimum <= figure <= maximum, f"{words} is {figure:.4g}, not {minimum:g} to {maximum:g}: {sitl}"


@word
def then(sitl: Sitl, *steps: Step) -> None:
    for each in steps:
        each(sitl)


def places(columns: Columns) -> Array:
    return np.stack([columns["x"], columns["y"], columns["z"]], axis=1)


def max_distance_from(place: Sequence[float]) -> Callable[[Columns], float]:
    return lambda columns: float(np.linalg.norm(places(columns) - place, axis=1).max())


def highest(columns: Columns) -> float:
    return float(columns["z"].max())


def max_tilt(columns: Columns) -> float:
    return float(tilt_deg(columns).max())
