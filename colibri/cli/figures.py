"""Options of `colibri figures`."""

from pathlib import Path

from colibri.common.process.arguments import ArgumentParser


def add_figures_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri figures`."""
    add = parser.add_argument
    add(
        "--out",
        type=Path,
        default=Path("out/thesis"),
        metavar="DIR",
        help="folder for PNG and SVG (default %(default)s)",
    )
    add("--only", action="append", metavar="NUMBER", help="only this figure, 4.9 say; may be repeated")
    add("--quiet", action="store_true", help="say nothing but errors")
