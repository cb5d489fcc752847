"""Serve the page of recorded flights before their reader is loaded."""

import webbrowser
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from colibri.common.process.lifecycle import loading
from colibri.view.page.server import address, serve, stop

_NEEDED = ("provenance.json", "flight.ulg")


def show_recorded(folders: Sequence[Path], port: int, *, browser: bool, say: Callable[[str], None]) -> None:
    with ExitStack() as held:
        if not all((folder / name).is_file() for folder in folders for name in _NEEDED):
            from colibri.view.run import read_flights

            read_flights(folders, held)  # raises, before a browser is opened in vain
        server = serve(port, "Colibri")
        held.callback(stop, server)
        say(address(server))
        if browser:
            webbrowser.open(address(server))
        with loading():
            from colibri.view.run import play
        play(folders, server)
