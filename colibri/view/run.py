"""Run the page."""

import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from math import inf
from os.path import realpath
from pathlib import Path
from threading import Event, Thread
from time import perf_counter, sleep
from typing import Any

import numpy as np

from colibri.common.files import write_bytes
from colibri.common.process.lifecycle import Stop
from colibri.view.live import LiveVehicle
from colibri.view.observer import CHOICES, VehicleObserver
from colibri.view.page.page import Page
from colibri.view.page.server import PageServer, Token, serve
from colibri.view.recorded.flight import RecordedFlight
from colibri.view.recorded.horizons import HorizonProcess, Horizons
from colibri.view.recorded.playback import Playback, speed_of
from colibri.view.snapshot import Source, ViewError

FRAMES_HZ = 30.0
EXPORT_HZ, EXPORT_FRAMES = 15.0, 6000  # rate of an exported page; lower in a long flight
WORDS_HZ = 5.0  # update rate of texts and time line, enough to read
PLOTS_HZ = 2.0  # update rate of plots, which are sent whole
PLOTTED_AFTER_S, WAITS_S = 0.7, 4.0
"""Delay of the first motion after a browser's layout, or at most its connection: it slows down drawing."""


class Show:
    """Updates the page as time passes, without waiting."""

    def __init__(
        self,
        page: Page,
        sources: Sequence[Source],
        now_s: float,
        order: Callable[[str, Any], None] = lambda _what, _value: None,
    ) -> None:
        begin_s, end_s = zip(*(source.span_s for source in sources), strict=True)
        self._page = page
        self._sources = sources
        self._order = order
        self.playback = Playback((min(begin_s), max(end_s)), now_s, min(begin_s))
        self._words_at_s = self._plots_at_s = now_s
        self._begins_at_s = inf
        self._has_begun = False
        self._shown: object = None
        self._is_told = self._is_plotted = False

    def turn(self, now_s: float) -> None:
        if not self._has_begun and self._page.watched:
            self._begins_at_s = min(self._begins_at_s, now_s + (PLOTTED_AFTER_S if self._page.laid_out else WAITS_S))
        if not self._has_begun and now_s >= self._begins_at_s:
            self._has_begun = True
            self._page.reveal([source.at(now_s) for source in self._sources])
            self._shown = None
            self.playback = self.playback.play(now_s)
        for done in self._page.done():
            self._shown = None
            if done.what == "play":
                moves = self.playback.plays and not self.playback.is_over(now_s)
                self.playback = self.playback.pause(now_s) if moves else self.playback.play(now_s)
            elif done.what == "seek":
                self.playback = self.playback.seek(done.value, now_s)
            elif done.what == "order":
                self._order(*done.value)
            elif done.what == "speed":
                self.playback = self.playback.at_speed(speed_of(done.value), now_s)
        live = any(source.is_live for source in self._sources)
        time_s = now_s if live else self.playback.time_s(now_s)
        if time_s != self._shown:
            self._shown = time_s
            self._page.show([source.at(time_s) for source in self._sources])
            self._is_told = self._is_plotted = False
        if not self._is_told and now_s >= self._words_at_s:
            self._words_at_s = now_s + 1.0 / WORDS_HZ
            self._is_told = True
            plays = self.playback.plays and not self.playback.is_over(now_s)
            self._page.tell([source.at(time_s) for source in self._sources], time_s, plays)
        if not self._is_plotted and now_s >= self._plots_at_s:
            self._plots_at_s = now_s + 1.0 / PLOTS_HZ
            self._is_plotted = True
            self._page.plot(time_s, anew=live)


def play(folders: Sequence[Path], server: PageServer) -> None:
    with ExitStack() as held:
        flights = read_flights(folders, held)
        page = Page(flights, server)
        _keep_showing(Show(page, flights, perf_counter()), Stop().__bool__)


def export(folders: Sequence[Path], path: Path) -> None:
    """Write an HTML file that plays flights, without plots."""
    with ExitStack() as held:
        flights = read_flights(folders, held, wait=True)
        begin_s, end_s = zip(*(flight.span_s for flight in flights), strict=True)
        first_s, last_s = min(begin_s), max(end_s)
        count = min(max(2, round(EXPORT_HZ * (last_s - first_s))), EXPORT_FRAMES)
        page = Page(flights, serve(0, "Colibri"))
        held.callback(page.close)
        html = page.recorded_html(np.linspace(first_s, last_s, count).tolist())
    try:
        write_bytes(path, html.encode())
    except OSError as error:
        raise ViewError(f"cannot write --export {path}: {error.strerror}") from error


def read_flights(folders: Sequence[Path], held: ExitStack, *, wait: bool = False) -> list[RecordedFlight]:
    """Read flights; horizons are computed while `held` is open, or `wait` for all."""
    horizons = [Horizons() for _ in folders]
    flights = [RecordedFlight(*each) for each in zip(folders, _names(folders), horizons, strict=True)]
    for folder, known in zip(folders, horizons, strict=True):
        process = HorizonProcess(folder, known)
        held.callback(process.close)
        if wait:
            process.wait()
    return flights


def show_live(url: str, port: int, *, browser: bool, say: Callable[[str], None]) -> None:
    with _live_page(url, port, browser=browser, say=say) as (_, show):
        _keep_showing(show, Stop().__bool__)


def pass_on(vehicle: LiveVehicle, what: str, value: Any) -> None:
    orders: dict[str, Callable[[VehicleObserver], None]] = {
        "arm": lambda observer: observer.arm(True),
        "disarm": lambda observer: observer.arm(False),
        "take off": lambda observer: observer.take_off(value),
        "land": VehicleObserver.land,
        "return": VehicleObserver.return_home,
        "mode": lambda observer: observer.set_mode(value),
        "go to": lambda observer: observer.go_to(value),
    }
    vehicle.order(orders[what])


@contextmanager
def page_beside(say: Callable[[str], None]) -> Iterator[str]:
    """Show the flight in this block from a thread; yield the link for the vehicle to connect to."""
    ends = Event()
    with _live_page("udpin:127.0.0.1:0", 0, name="vehicle", browser=True, say=say) as (vehicle, show):
        thread = Thread(target=_keep_showing, args=(show, ends.is_set), daemon=True)
        thread.start()
        try:
            yield vehicle.url.replace("udpin", "udpout")
        finally:
            ends.set()
            thread.join()


@contextmanager
def _live_page(
    url: str, port: int, *, name: str = "", browser: bool, say: Callable[[str], None]
) -> Iterator[tuple[LiveVehicle, Show]]:
    with closing(LiveVehicle(url, name)) as vehicle, closing(Page([vehicle], serve(port, "Colibri"))) as page:
        say(page.url)
        token = Token.new()
        say(f"token for commands: {token.text}")
        page.offer_commands(token, lambda: CHOICES.get(vehicle.autopilot or 0, ()))
        show = Show(page, [vehicle], perf_counter(), partial(pass_on, vehicle))
        if browser:
            webbrowser.open(page.url)
        yield vehicle, show


def _keep_showing(show: Show, ends: Callable[[], bool]) -> None:
    while not ends():
        began_s = perf_counter()
        show.turn(began_s)
        sleep(max(0.0, began_s + 1.0 / FRAMES_HZ - perf_counter()))


def _names(folders: Sequence[Path]) -> list[str]:
    paths = [Path(realpath(folder)).parts for folder in folders]
    if len(set(paths)) < len(paths):
        raise ViewError(f"{folders[0]} is given twice: name two flights")
    for count in range(1, max(map(len, paths)) + 1):
        names = ["/".join(parts[-count:]) for parts in paths]
        if len(set(names)) == len(names):
            return names
    raise AssertionError("paths that differ have parts that differ")
