"""First steps of a process: link, status line, signals."""

import gc
from collections.abc import Callable
from typing import TypeVar

from colibri.common.process.lifecycle import Stop, end_quickly, fail, use_one_thread
from colibri.common.process.output import use_streams
from colibri.common.process.spec import Starter
from colibri.common.process.status import Status
from colibri.mavlink.links.link import GroundLink, LinkError

Link = TypeVar("Link")

COMPILING = "compiling, once: half a minute and more"


def begin(name: str, url: str, starter: Starter, opened: Callable[[str], Link]) -> tuple[Link, Status, Stop]:
    """Open the link at `url` and handle signals, or end with one line; call before numpy is loaded."""
    use_streams()
    use_one_thread()
    end_quickly()
    gc.disable()  # until all is loaded, see `gc_frozen`: what is loaded stays
    stop = Stop(parent=starter.parent, starting=True)
    try:
        link = opened(url)
    except LinkError as error:
        fail(str(error))
    status = Status(name, as_json=starter.as_json)
    if starter.as_json:
        status.take_standard_output(patient=starter.parent is not None)
    return link, status, stop


def awaiting(whom: str, link: GroundLink) -> str:
    return f"waiting for {whom} on {link.url}" if link.target is None else f"connecting to {whom} at {link.url}"


def report_compiling(status: Status) -> None:
    """Report to people once, to programs each function. Loads numba."""
    from colibri.common.jit import on_compile

    def report(functions: int) -> None:
        if status.as_json or functions == 1:
            status.say("compiling", COMPILING, functions=functions)

    on_compile(report)
