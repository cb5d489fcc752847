"""`colibri plot`, `export` and `view`, and the commands with `--view`: `fly` and `sitl`."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from colibri.common.errors import Error
from colibri.common.process.lifecycle import fail, loading, one_line
from colibri.common.spec import from_namespace

_LINKS = ("udpin:", "udpout:", "tcp:", "tcpin:", "serial:")


def fly(args: Namespace) -> int:
    with loading():
        from colibri.cli.flying import fly as flown
    if args.view and args.link != "udp":
        fail(f"--view needs --link udp: with --link {args.link} there is no autopilot process")
    with _viewed(args, args.gcs):
        return flown(args)


def sitl(args: Namespace) -> int:
    with loading():
        from colibri.flights.fleet import sitl as fleet
        from colibri.flights.fleet_spec import FleetSpec
    if args.view and args.count > 1:
        fail("--view shows one vehicle: leave --count out")
    with _viewed(args, from_namespace(FleetSpec, args).links(args.instance)):
        return fleet(from_namespace(FleetSpec, args), quiet=args.quiet)


def view(args: Namespace) -> int:
    links = [what for what in args.what if what.startswith(_LINKS)]
    if links and len(args.what) > 1:
        fail("a live vehicle is shown alone: give one link, or folders of flights")
    if links and args.export:
        fail("--export writes recorded flights: give their folders")
    if args.port > 65535:
        fail(f"--port: must be from 0 to 65535, not {args.port}")
    recorded = not links and not args.export
    with _loading_viser():
        if recorded:
            from colibri.view.opening import show_recorded
        else:
            from colibri.view.run import export, show_live
    with one_line():
        if recorded:
            show_recorded([Path(what) for what in args.what], args.port, browser=not args.no_browser, say=_say)
        elif args.export:
            export([Path(what) for what in args.what], args.export)
        else:
            show_live(links[0], args.port, browser=not args.no_browser, say=_say)
    return 0


@contextmanager
def _loading_viser() -> Iterator[None]:
    """Load modules that import viser, if it is installed."""
    try:
        with loading():
            yield
    except ModuleNotFoundError as error:
        if error.name not in ("viser", "websockets"):
            raise
        fail("the page needs viser: pip install 'colibri-sitl[view]'")


def _say(line: str) -> None:
    print(line, flush=True)


@contextmanager
def _viewed(args: Namespace, links: list[str]) -> Iterator[None]:
    if not args.view:
        yield
        return
    with _loading_viser():
        from colibri.view.run import page_beside
    with one_line(), page_beside(_say) as link:
        args.gcs = [*links, link]
        yield


def plot(args: Namespace) -> int:
    from colibri.analysis.figure_series import FigureSeries
    from colibri.analysis.figures import draw_flight
    from colibri.analysis.recording import FlightReader
    from colibri.flights.provenance import plan_of

    try:
        reader = FlightReader(plan_of(args.folder))
        paths = draw_flight(FigureSeries(reader.plan, reader.samples, reader), reader.plan)
    except Error as error:
        fail(f"{args.folder}: {error}" if str(args.folder) not in str(error) else str(error))
    except OSError as error:
        fail(f"{error.filename or args.folder}: {error.strerror}")
    if not args.quiet:
        print(*paths, sep="\n")
    return 0


def export(args: Namespace) -> int:
    from colibri.analysis import export as formats

    if not (args.mcap or args.csv or args.mat or args.parquet):
        fail("choose a format: --mcap, --csv, --mat, --parquet, or several of them")
    written = []
    try:
        path = formats.log_file(args.log)
        tables = path.with_name(f"{path.stem}-topics")
        if args.csv and formats.write_flight_tables(path, tables):
            written.append(tables)
        log = formats.read_log(path)
        if args.mcap:
            written.append(formats.write_mcap(log, path.with_suffix(".mcap")))
        if args.csv:
            written.append(formats.write_csv(log, tables))
        if args.mat:
            written.append(formats.write_mat(log, path.with_suffix(".mat")))
        if args.parquet:
            written.append(formats.write_parquet(log, tables))
    except Error as error:
        fail(str(error))
    except OSError as error:
        fail(f"cannot write {error.filename or args.log}: {error.strerror}")
    if not args.quiet:
        print(*dict.fromkeys(written), sep="\n")
    return 0
