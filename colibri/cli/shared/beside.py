"""`--view`: the page in a browser beside a flight."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from colibri.common.errors import Error
from colibri.common.process.lifecycle import fail, loading

NEEDS_VISER = "the page needs viser: pip install 'colibri-sitl[view]'"


def add_view(add: Any) -> None:
    add("--view", action="store_true", help="show it in a browser as it flies; the page's address is the first line")


@contextmanager
def viewed(args: Namespace, links: list[str]) -> Iterator[None]:
    """Show the flight over an additional link if `--view` is given."""
    if not args.view:
        yield
        return
    try:
        with loading():
            from colibri.view.run import page_beside
    except ModuleNotFoundError as error:
        if error.name not in ("viser", "websockets"):
            raise
        fail(NEEDS_VISER)
    try:
        with page_beside(_say) as link:
            args.gcs = [*links, link]
            yield
    except Error as error:
        fail(str(error))


def _say(line: str) -> None:
    print(line, flush=True)  # noqa: T201
