"""`view-*.png`: the page of `colibri view` in Chromium."""

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from io import BytesIO
from math import dist
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

from PIL import Image

from colibri.common.types import Vector
from colibri.experiments.flight import fly
from colibri.mavlink.client.modes import PX4
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.mission_items import Item, circle, land, polygon, takeoff, waypoint
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl
from colibri.view.live import LiveVehicle, ObservedVehicle
from colibri.view.observer import CHOICES, VehicleObserver
from colibri.view.page.page import Page
from colibri.view.page.server import Token, serve
from colibri.view.run import WAITS_S, Show, read_flights
from colibri.view.snapshot import Source
from tools.pages.pictures.chromium import Tab, chromium
from tools.pages.pictures.watched import watched

FRAME_S, PLOTTED_AGAIN = 0.1, 8
DRAWN_AFTER_MS = 15000  # without a GPU a picture takes seconds
COLOURS = 160
KNOWN_AFTER_S, ON_ITS_WAY_S, PATIENCE_S, NEAR_M = 10.0, 3.0, 60.0, 0.5
PLACES_M = ((0.0, 0.0, 4.0), (8.0, 0.0, 4.0), (8.0, 6.0, 5.0), (0.0, 6.0, 5.0))
TOKEN = Token("docs")


def write(folder: Path) -> None:
    recorded(folder / "view-recorded.png")
    compared(folder / "view-two.png")
    live(folder / "view-live.png")
    mission(folder / "view-mission.png")
    real(folder / "view-real.png")


def recorded(path: Path) -> None:
    flight = fly("lemniscate:lap=5", duration=15.0, feedback="sensors", wind="5@270", turbulence="light", link="memory")
    with ExitStack() as held:
        folder = held.enter_context(TemporaryDirectory())
        flights = read_flights([flight.save(folder)], held, wait=True)
        flights[0].name = "lemniscate"
        keep(path, flights, 12.5)


def compared(path: Path) -> None:
    begun = partial(fly, "lemniscate:lap=5", duration=6.0, wind="8@270", turbulence="moderate", link="memory")
    both = [begun(), begun(controller="geometric-se3")]
    with ExitStack() as held:
        folder = Path(held.enter_context(TemporaryDirectory()))
        saved = [flight.save(folder / str(number)) for number, flight in enumerate(both)]
        flights = read_flights(saved, held, wait=True)
        for flight, name in zip(flights, ("lpv-mpc", "geometric-se3"), strict=True):
            flight.name = name
        keep(path, flights, 4.2)


def live(path: Path) -> None:
    with begun(feedback="sensors", wind="4@300") as sitl:
        vehicle = ObservedVehicle("udpin:127.0.0.1:14550", watched(sitl))
        sitl.run(3.0)
        sitl.arm()
        sitl.takeoff(3.0)
        sitl.goto(6.0, 3.0, 4.0, wait=False)
        sitl.run(2.2)
        keep(path, [vehicle], sitl.time_s, commands=True)


def mission(path: Path) -> None:
    with begun(wind="3@200") as sitl:
        vehicle = ObservedVehicle("udpin:127.0.0.1:14550", watched(sitl))
        corners = [(-6.0, -6.0), (12.0, -6.0), (12.0, 10.0), (-6.0, 10.0)]
        sitl.upload_fence([*polygon(corners), *circle(2.0, (4.0, 3.0), keep_out=True)])
        sitl.upload_rally([Item(mav.MAV_CMD_NAV_RALLY_POINT, place=(-4.0, 7.0, 3.0))])
        places = ((8.0, 0.0, 3.0), (8.0, 7.0, 4.0), (0.0, 7.0, 4.0), (0.0, 3.0, 3.0))
        sitl.upload_mission([takeoff(3.0), *(waypoint(*place) for place in places), land(0.0, 0.0)])
        sitl.arm()
        sitl.start_mission()
        sitl.run(11.0)
        keep(path, [vehicle], sitl.time_s)


@contextmanager
def begun(**setting: str) -> Iterator[Sitl]:
    with Flights(setting_of([setting]), None) as flights:
        yield flights.begin()


def real(path: Path) -> None:
    vehicle = LiveVehicle("udpin:127.0.0.1:0")
    with TemporaryDirectory() as folder, closing(vehicle):
        link = ["--gcs", vehicle.url.replace("udpin", "udpout"), "--plant-port", "0", "--state", folder]
        world = ["--feedback", "sensors", "--wind", "5@300", "--turbulence", "light", "--seed", "3"]
        command = [sys.executable, "-m", "colibri", "sitl", "--quiet", *link, *world]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL) as sitl:
            try:
                fly_by_orders(vehicle)
                keep(path, [vehicle], partial(on_its_way, vehicle), commands=True)
            finally:
                sitl.terminate()


def fly_by_orders(vehicle: LiveVehicle) -> None:
    wait(lambda: vehicle.at(perf_counter()).mode == "Hold")
    sleep(KNOWN_AFTER_S)
    vehicle.order(lambda observer: observer.arm(True))
    wait(lambda: vehicle.at(perf_counter()).armed)
    vehicle.order(lambda observer: observer.take_off(PLACES_M[0][2]))
    wait(lambda: vehicle.at(perf_counter()).position_enu_m[2] > PLACES_M[0][2] - NEAR_M)
    for place in PLACES_M:
        vehicle.order(partial(VehicleObserver.go_to, place_enu_m=place))
        wait(partial(is_near, vehicle, place))


def is_near(vehicle: LiveVehicle, place: Vector) -> bool:
    return dist(vehicle.at(perf_counter()).position_enu_m, place) < NEAR_M


def on_its_way(vehicle: LiveVehicle) -> float:
    vehicle.order(partial(VehicleObserver.go_to, place_enu_m=PLACES_M[1]))
    sleep(ON_ITS_WAY_S)
    return perf_counter()


def wait(until: Callable[[], object]) -> None:
    give_up_s = perf_counter() + PATIENCE_S
    while not until():
        assert perf_counter() < give_up_s, "the vehicle does not do as it is told"
        sleep(0.02)


def keep(path: Path, sources: Sequence[Source], time_s: float | Callable[[], float], *, commands: bool = False) -> None:
    """Write a picture at a time, evaluated once the browser is open."""
    page = Page(sources, serve(0, "Colibri"))
    if commands:
        page.offer_commands(TOKEN, lambda: CHOICES[PX4])
    try:
        with chromium() as tab:
            Tab(tab, page.url)
            tab.get_by_text("position error, m").wait_for()
            tab.locator(".mantine-Notification-closeButton").click()
            if commands:
                tab.locator("input.mantine-TextInput-input").last.fill(TOKEN.text)
                tab.get_by_role("button", name="Unlock").click()
            shown_s = time_s() if callable(time_s) else time_s
            begin_s = shown_s if sources[0].is_live else 0.0
            show = Show(page, sources, begin_s - WAITS_S)
            show.turn(begin_s - WAITS_S)
            show.turn(begin_s)
            show.playback = show.playback.seek(shown_s, begin_s).pause(begin_s)
            for frame in range(PLOTTED_AGAIN):
                show.turn(begin_s + frame * FRAME_S)
            tab.wait_for_timeout(DRAWN_AFTER_MS)
            png = tab.screenshot()
    finally:
        page.close()
    Image.open(BytesIO(png)).convert("RGB").quantize(COLOURS).save(path, optimize=True)
