"""What every script needs: a vehicle at a URL, waiting for what telemetry tells, a take-off."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import cos, hypot, radians
from queue import Queue
from time import monotonic, sleep
from typing import Any

from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk, MavsdkError
from mavsdk.plugins.action import Action
from mavsdk.plugins.telemetry import FlightMode, Telemetry

_LOOK_EVERY_S = 0.01
_FOUND_WITHIN_S = 20.0
METRES_PER_DEGREE = 111_319.5  # of latitude; for places a few metres apart


@contextmanager
def connected(url: str) -> Iterator[Any]:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        result = mavsdk.add_any_connection(url)
        if result != ConnectionResult.SUCCESS:
            raise ConnectionError(f"{url}: {result.name}")
        vehicle = mavsdk.first_autopilot(_FOUND_WITHIN_S)
        if vehicle is None:
            raise ConnectionError(f"{url}: no vehicle")
        yield vehicle
    finally:
        mavsdk.destroy()


def until(condition: Callable[[], object], what: str, within_s: float = 60.0) -> None:
    """Wait until `condition()`; `within_s` is a wall-clock bound for what hangs."""
    give_up_s = monotonic() + within_s
    while not condition():
        if monotonic() > give_up_s:
            raise TimeoutError(f"waited in vain for {what}")
        sleep(_LOOK_EVERY_S)


def streamed(begin: Callable[[Callable[..., None]], None], next_result: object, within_s: float = 60.0) -> list[Any]:
    """Run a call that reports as it goes, `next_result` while more comes; return its reports."""
    results: Queue[tuple[Any, Any]] = Queue()
    begin(lambda result, data, _=None: results.put((result, data)))
    reports: list[Any] = []
    while True:
        result, data = results.get(timeout=within_s)
        if result != next_result:
            if result.name != "SUCCESS":
                raise RuntimeError(result.name)
            return reports
        reports.append(data)


def refused(call: Callable[[], object], reason: object) -> None:
    try:
        call()
    except MavsdkError as error:
        if getattr(error, "result", None) != reason:
            raise
        return
    raise AssertionError(f"not refused: {reason}")


def distance_m(telemetry: Telemetry, north_m: float, east_m: float, down_m: float) -> float:
    at = telemetry.position_velocity_ned().position
    return hypot(at.north_m - north_m, at.east_m - east_m, at.down_m - down_m)


def take_off(vehicle: Any, height_m: float) -> tuple[Action, Telemetry]:
    action, telemetry = Action(vehicle), Telemetry(vehicle)
    until(lambda: telemetry.health().is_armable and telemetry.health().is_home_position_ok, "a vehicle to arm")
    action.set_takeoff_altitude(height_m)
    action.arm()
    action.takeoff()
    until(lambda: telemetry.flight_mode() == FlightMode.TAKEOFF, "the take-off")
    until(lambda: telemetry.flight_mode() == FlightMode.HOLD, "the height")
    return action, telemetry


def place(telemetry: Telemetry, north_m: float, east_m: float) -> tuple[float, float]:
    """Return latitude and longitude of a place that far from home: right to a few centimetres for tens of metres."""
    home = telemetry.home()
    latitude = home.latitude_deg + north_m / METRES_PER_DEGREE
    return latitude, home.longitude_deg + east_m / (METRES_PER_DEGREE * cos(radians(home.latitude_deg)))
