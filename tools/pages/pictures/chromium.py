"""A headless Chromium: it draws WebGL without a GPU, slowly."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Page, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
SIZE = (1280, 800)
WITHIN_MS = 60_000  # without a GPU a picture takes seconds
_KNOWN_WARNINGS = ("THREE.Clock", "Evaluating a string as JavaScript")
"""The second: viser's sorter of Gaussian splats is refused."""


class Tab:
    """A tab; `complaints` are errors and requests to other computers."""

    def __init__(self, page: Page, url: str) -> None:
        self.page = page
        self.complaints: list[str] = []
        page.set_default_timeout(WITHIN_MS)
        page.on("console", lambda message: self._console(message.type, message.text))
        page.on("pageerror", lambda error: self._console("error", str(error)))
        page.on("request", lambda request: self._request(request.url))
        page.goto(url)

    def _console(self, kind: str, text: str) -> None:
        if kind in ("error", "warning") and not any(known in text for known in _KNOWN_WARNINGS):
            self.complaints.append(text)

    def _request(self, url: str) -> None:
        if not url.startswith(("http://127.0.0.1:", "data:", "blob:")):
            self.complaints.append(f"asks {url}")


@contextmanager
def chromium() -> Iterator[Page]:
    path = next(filter(None, map(shutil.which, NAMES)), None)
    assert path is not None, "no Chromium: apt-get install chromium"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        width, height = SIZE
        yield browser.new_page(viewport={"width": width, "height": height})
        browser.close()
