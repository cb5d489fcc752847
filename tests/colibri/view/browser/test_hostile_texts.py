"""Names and texts from outside in a real browser: text, whatever they contain; and no foreign script runs."""

import numpy as np
import pytest

from colibri.view.page.page import Page
from colibri.view.page.server import serve
from colibri.view.run import Show
from colibri.view.snapshot import Chart, Snapshot, Surroundings, VehicleShape

pytestmark = pytest.mark.view
HOSTILE = (
    "<img src=x onerror='window.ran=1'>",
    "</p><iframe srcdoc='<script>parent.ran=1</script>'></iframe>",
    "**bold** [link](javascript:window.ran=1) https://evil.example",
    "<svg onload='window.ran=1'><a href='https://evil.example'>link</a></svg>&lt;",
)
ADDS_HTML = "text => { const it = document.createElement('div'); it.innerHTML = text; document.body.append(it); }"


class Hostile:
    """A vehicle whose name and texts are HTML; a `Source`."""

    is_live, span_s, airframe, surroundings = True, (0.0, 1.0), VehicleShape(), Surroundings()

    def __init__(self, name: str) -> None:
        self.name = name

    def at(self, time_s: float) -> Snapshot:
        mode, battery, *_ = HOSTILE
        place, level = (0.0,) * 3, (1.0, 0.0, 0.0, 0.0)
        return Snapshot(time_s=time_s, position_enu_m=place, attitude=level, mode=mode, battery=battery, texts=HOSTILE)

    def charts(self) -> tuple[Chart, ...]:
        times_s = np.arange(3.0)
        return (Chart(f"chart {HOSTILE[0]}", (HOSTILE[3],), times_s, times_s[None], times_s),)


def test_hostile_names_and_texts_are_shown_as_text() -> None:
    from tools.pages.pictures.chromium import Tab, chromium

    sources = [Hostile(HOSTILE[0]), Hostile(HOSTILE[1])]
    page = Page(sources, serve(0, "Colibri"))
    with chromium() as tab_page:
        tab = Tab(tab_page, page.url)
        Show(page, sources, 0.0).turn(0.0)
        for text in HOSTILE:
            tab_page.get_by_text(text, exact=False).first.wait_for()
        assert tab_page.locator("iframe, img[src=x], a[href*=evil], a[href^=javascript]").count() == 0
        assert tab_page.locator(".u-legend").get_by_text(HOSTILE[0]).count()
        assert not tab.complaints
        for text in HOSTILE:
            tab_page.evaluate(ADDS_HTML, text)
        tab_page.wait_for_timeout(300.0)
        assert tab_page.evaluate("window.ran") is None
        assert any("Content Security Policy" in text for text in tab.complaints)
    page.close()
