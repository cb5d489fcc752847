"""A recorded flight in a real browser: what it shows, what its buttons do, that it complains of nothing."""

from collections.abc import Iterator
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from colibri.experiments.flight import fly
from colibri.view.page.page import Page
from colibri.view.page.server import serve
from colibri.view.recorded.flight import RecordedFlight
from colibri.view.run import Show

pytestmark = pytest.mark.view
NOW = (0xD0, 0x10, 0x80)
BLUE_OVER_RED = 60
"""By how much what is drawn of the first vehicle is bluer than it is red: nothing else in the middle is."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedFlight:
    flight = fly("spiral", duration=6.0, profile="flight", link="memory")
    return RecordedFlight(flight.save(tmp_path_factory.mktemp("flight")), "spiral flight")


@pytest.fixture
def page(recorded: RecordedFlight) -> Iterator[Page]:
    begun = Page([recorded], serve(0, "Colibri"))
    yield begun
    begun.close()


def test_it_shows_the_flight_and_obeys_its_buttons(page: Page, recorded: RecordedFlight) -> None:
    from tools.pages.pictures.chromium import Tab, chromium

    show = Show(page, [recorded], 0.0)
    show.turn(0.0)
    with chromium() as tab_page:
        tab = Tab(tab_page, page.url)
        tab_page.get_by_text("spiral flight").wait_for()
        tab_page.get_by_text("position error, m").wait_for()
        show.turn(0.5)
        show.turn(1.0)
        show.turn(1.5)
        tab_page.locator(".mantine-Notification-closeButton").click()
        assert show.playback.plays
        tab_page.get_by_role("button", name="Pause").click()
        _obey(page, show, 2.0)
        assert not show.playback.plays
        time = tab_page.locator("input.mantine-NumberInput-input").first
        time.fill("5")
        time.press("Enter")
        _obey(page, show, 3.0)
        assert show.playback.time_s(3.0) == 5.0
        show.turn(4.0)
        tab_page.get_by_text("t 5.00 s").wait_for()
        tab_page.get_by_role("button", name="Play").wait_for()
        shot = tab_page.screenshot()
        pixels = np.asarray(Image.open(BytesIO(shot)).convert("RGB"), dtype=int)
        now = np.abs(pixels - NOW).sum(axis=2) < 120
        assert now.sum(axis=0).max() > 100, "a line upwards in each plot"
        assert now.sum(axis=1).max() < 20, "and none along an axis"
        picture = pixels[:, 300:890]  # between the panels
        assert np.count_nonzero(picture[:, :, 2] > picture[:, :, 0] + BLUE_OVER_RED) > 200
        assert not tab.complaints


def _obey(page: Page, show: Show, now_s: float) -> None:
    done = page.controls.done.get(timeout=60.0)
    page.controls.done.put(done)
    show.turn(now_s)
