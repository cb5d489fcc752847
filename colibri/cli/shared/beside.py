"""`--view`: the page in a browser beside a flight."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail, loading, one_line


def add_view(parser: ArgumentParser) -> None:
    parser.flag("--view", "show it in a browser as it flies; the page's address is the first line")


@contextmanager
def loading_viser() -> Iterator[None]:
    """Load modules that import viser, if it is installed."""
    try:
        with loading():
            yield
    except ModuleNotFoundError as error:
        if error.name not in ("viser", "websockets"):
            raise
        fail("the page needs viser: pip install 'colibri-sitl[view]'")


def say(line: str) -> None:
    print(line, flush=True)


@contextmanager
def viewed(args: Namespace, links: list[str]) -> Iterator[None]:
    if not args.view:
        yield
        return
    with loading_viser():
        from colibri.view.run import page_beside
    with one_line(), page_beside(say) as link:
        args.gcs = [*links, link]
        yield
