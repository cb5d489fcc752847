"""`colibri sitl --view`, flown by the buttons of its page in a real browser, and observed on another link."""

import re
from math import dist
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from tools.harness.processes import vehicle

pytestmark = pytest.mark.view
HEIGHT_M = 3.0  # as the page proposes
NEAR_M = 0.2


def test_a_vehicle_is_armed_takes_off_goes_and_lands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tools.pages.pictures.chromium import Tab, chromium

    monkeypatch.setenv("BROWSER", "true")  # the command `true`: the browser is opened here
    with vehicle(tmp_path, "--view") as flown, chromium() as page:
        url, token, *_ = flown.printed
        tab = Tab(page, url)
        page.get_by_role("button", name="Unlock").wait_for()
        page.locator(".mantine-Notification-closeButton").click()
        page.locator("input.mantine-TextInput-input").last.fill(token.removeprefix("token for commands: "))
        page.get_by_role("button", name="Unlock").click()

        page.get_by_role("button", name="Arm", exact=True).click()
        flown.seen.wait(lambda sight: sight.armed, "arming")
        page.get_by_role("button", name="Take off", exact=True).click()
        flown.seen.wait(lambda sight: sight.mode is Mode.HOLD and abs(sight.height_m - HEIGHT_M) < NEAR_M, "the climb")

        page.get_by_role("checkbox", name="Go to").check()
        page.mouse.click(600, 650)
        said = page.get_by_text(re.compile(r"go to \S+ \S+ accepted")).inner_text()
        east, north = map(float, re.findall(r"go to (\S+), (\S+):", said)[-1])
        assert dist((0.0, 0.0), (east, north)) > 1.0
        flown.seen.wait(lambda sight: dist(sight.position_enu_m, (east, north, HEIGHT_M)) < NEAR_M, "the place")

        page.get_by_role("button", name="Land", exact=True).click()
        flown.seen.wait(lambda sight: sight.mode is Mode.LAND, "the descent")
        down = flown.seen.wait_until_disarmed()
        assert dist(down.position_enu_m, (east, north, 0.0)) < 2.0 * NEAR_M
        page.get_by_text("Disarmed by landing").wait_for()
        page.get_by_text("disarmed").wait_for()
        assert not tab.complaints
