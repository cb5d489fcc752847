"""Options of `colibri replay`."""

from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_replay_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri replay`."""
    add = parser.add_argument
    add("tlog", type=Path, metavar="FLIGHT.TLOG", help="as `colibri fly` leaves it, with inputs.jsonl beside it")
    add("--quiet", action="store_true", help="say nothing but errors")
