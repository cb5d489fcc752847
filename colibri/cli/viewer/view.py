"""`colibri view`."""

from argparse import Namespace
from pathlib import Path

from colibri.cli.shared.beside import loading_viser, say
from colibri.common.process.arguments import ArgumentParser, natural
from colibri.common.process.lifecycle import fail, one_line

_LINKS = ("udpin:", "udpout:", "tcp:", "tcpin:", "serial:")


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add(
        "what",
        "FOLDER|LINK",
        "flights by their folders, written by `colibri fly` (several are shown together); or a link to a "
        "MAVLink vehicle: udpin:, udpout:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD",
        nargs="+",
    )
    add("--port", "N", "of the page, on loopback (default: any that is free)", type=natural, default=0)
    add("--export", "FILE.html", "write flights as one file that plays them, and end", type=Path)
    parser.flag("--no-browser", "only print the page's address, alone on the first line")


def run(args: Namespace) -> int:
    links = [what for what in args.what if what.startswith(_LINKS)]
    if links and len(args.what) > 1:
        fail("one link, or folders of flights: a live vehicle and others are not shown together")
    if links and args.export:
        fail("--export writes flights that are over: give their folders")
    if args.port > 65535:
        fail(f"--port: must be from 0 to 65535, not {args.port}")
    recorded = not links and not args.export
    with loading_viser():
        if recorded:
            from colibri.view.opening import show_recorded
        else:
            from colibri.view.run import export, show_live
    with one_line():
        if recorded:
            show_recorded([Path(what) for what in args.what], args.port, browser=not args.no_browser, say=say)
        elif args.export:
            export([Path(what) for what in args.what], args.export)
        else:
            show_live(links[0], args.port, browser=not args.no_browser, say=say)
    return 0
