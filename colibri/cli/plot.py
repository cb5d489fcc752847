"""`colibri plot`."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("folder", "DIR", "as `colibri fly` leaves it, however the flight ended", type=Path)
    parser.flag("--quiet", "print errors only")


def run(args: Namespace) -> int:
    from colibri.analysis.figures import draw_flight
    from colibri.analysis.recording import FlightReader
    from colibri.analysis.series.figure_series import FigureSeries
    from colibri.common.errors import Error
    from colibri.flights.provenance import plan_of

    try:
        plan = plan_of(args.folder)
        paths = draw_flight(FigureSeries(plan, FlightReader(plan)), plan)
    except Error as error:
        fail(f"{args.folder}: {error}" if str(args.folder) not in str(error) else str(error))
    except OSError as error:
        fail(f"{error.filename or args.folder}: {error.strerror}")
    if not args.quiet:
        print(*paths, sep="\n")
    return 0
