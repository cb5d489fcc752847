"""`colibri plot` and `colibri export`: figures and other formats of a recorded flight."""

from argparse import Namespace

from colibri.common.errors import Error
from colibri.common.process.lifecycle import fail


def plot(args: Namespace) -> int:
    from colibri.analysis.figure_series import FigureSeries
    from colibri.analysis.figures import draw_flight
    from colibri.analysis.recording import FlightReader
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
            written.append(formats.write_mat(log, path, path.with_suffix(".mat")))
        if args.parquet:
            written.append(formats.write_parquet(log, tables))
    except Error as error:
        fail(str(error))
    except OSError as error:
        fail(f"cannot write {error.filename or args.log}: {error.strerror}")
    if not args.quiet:
        print(*dict.fromkeys(written), sep="\n")
    return 0
