"""`colibri export`."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("log", "DIR|FILE.ulg", "a flight by its folder, or any ULog, PX4's too", type=Path)
    parser.flag("--mcap", "write flight.mcap beside it, for Foxglove")
    parser.flag("--csv", "write flight-topics/*.csv beside it, a table of each topic")
    parser.flag("--mat", "write flight.mat beside it, a struct of each topic, for MATLAB and Octave")
    parser.flag("--parquet", "write flight-topics/*.parquet beside it, a table of each topic")
    parser.flag("--quiet", "print errors only")


def run(args: Namespace) -> int:
    from colibri.analysis.export import (
        log_file,
        read_log,
        write_csv,
        write_flight_tables,
        write_mat,
        write_mcap,
        write_parquet,
    )
    from colibri.common.errors import Error

    if not (args.mcap or args.csv or args.mat or args.parquet):
        fail("choose a format: --mcap, --csv, --mat, --parquet, or several of them")
    written = []
    try:
        path = log_file(args.log)
        tables = path.with_name(f"{path.stem}-topics")
        if args.csv and write_flight_tables(path, tables):
            written.append(tables)
        log = read_log(path)
        if args.mcap:
            written.append(write_mcap(log, path.with_suffix(".mcap")))
        if args.csv:
            written.append(write_csv(log, tables))
        if args.mat:
            written.append(write_mat(log, path, path.with_suffix(".mat")))
        if args.parquet:
            written.append(write_parquet(log, tables))
    except Error as error:
        fail(str(error))
    except OSError as error:
        fail(f"cannot write {error.filename or args.log}: {error.strerror}")
    if not args.quiet:
        print(*dict.fromkeys(written), sep="\n")
    return 0
