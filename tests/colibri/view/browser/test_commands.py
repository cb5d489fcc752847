"""Commands in a real browser: none without the token, and then each as it is pressed."""

from collections.abc import Iterator

import pytest

from colibri.mavlink.client.modes import PX4
from colibri.view.live import LiveVehicle
from colibri.view.observer import CHOICES
from colibri.view.page.page import Page
from colibri.view.page.server import Token, serve
from colibri.view.run import Show

pytestmark = pytest.mark.view
TOKEN = Token("a-token")


@pytest.fixture
def vehicle() -> Iterator[LiveVehicle]:
    begun = LiveVehicle("udpin:127.0.0.1:0", name="a vehicle")
    yield begun
    begun.close()


@pytest.fixture
def page(vehicle: LiveVehicle) -> Iterator[Page]:
    begun = Page([vehicle], serve(0, "Colibri"))
    begun.offer_commands(TOKEN, lambda: CHOICES[PX4])
    yield begun
    begun.close()


def test_a_browser_commands_once_it_has_said_the_token(page: Page, vehicle: LiveVehicle) -> None:
    from tools.pages.pictures.chromium import Tab, chromium

    orders: list[tuple[str, object]] = []
    show = Show(page, [vehicle], 0.0, lambda what, value: orders.append((what, value)))
    show.turn(0.0)
    with chromium() as tab_page:
        tab = Tab(tab_page, page.url)
        button = tab_page.get_by_role("button", name="Unlock")
        button.wait_for()
        assert not tab_page.get_by_role("button", name="Arm", exact=True).count()
        said = tab_page.locator("input.mantine-TextInput-input").last
        said.fill("another")
        button.click()
        tab_page.get_by_text("That is not the token").wait_for()
        said.fill(TOKEN.text)
        button.click()
        for name in ("Arm", "Take off", "Land", "Return", "Change mode"):
            tab_page.get_by_role("button", name=name, exact=True).click()
            page.controls.done.put(page.controls.done.get(timeout=60.0))
            show.turn(1.0)
        tab_page.get_by_role("checkbox", name="Go to").check()
        tab_page.locator(".mantine-Notification-closeButton").click()
        tab_page.mouse.click(600, 650)
        page.controls.done.put(page.controls.done.get(timeout=60.0))
        show.turn(2.0)
        assert not tab.complaints
    assert [what for what, _ in orders] == ["arm", "take off", "land", "return", "mode", "go to"]
    assert orders[4][1] == CHOICES[PX4][0]
    place = orders[5][1]
    assert isinstance(place, tuple)
    assert place[2] == 3.0
