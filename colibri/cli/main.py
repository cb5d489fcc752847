"""`colibri`: the one command. Loads only what the subcommand needs."""

import signal
import sys
import threading

from colibri.cli.bench import add_bench_options
from colibri.cli.compare import add_compare_options, in_another_world
from colibri.cli.figures import add_figures_options
from colibri.cli.fly import add_fly_options
from colibri.cli.processes import PROCESSES, run_process
from colibri.cli.replay import add_replay_options
from colibri.cli.sitl import add_sitl_options
from colibri.cli.study import add_study_options
from colibri.cli.verify import add_verify_options
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import EXIT_INTERRUPTED, fail, use_one_thread


def main(argv: list[str] | None = None) -> int:
    """Run a subcommand; return the exit code."""
    given = sys.argv[1:] if argv is None else argv
    if given and given[0] in PROCESSES:
        return run_process(given[0], given[1:])
    args = _parser().parse_args(given)
    use_one_thread()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that what was started is ended, too
    try:
        if args.command == "fly":
            from colibri.cli.fly_and_report import fly

            return fly(args)
        if args.command == "figures":
            from colibri.studies.thesis_figures import figures

            return figures(args)
        if args.command == "compare" and in_another_world(args):
            from colibri.studies.seeds import compare_seeds

            return compare_seeds(args)
        if args.command == "compare":
            from colibri.studies.compare import compare

            return compare(args)
        if args.command == "study":
            from colibri.studies.studies import study

            return study(args)
        if args.command == "sitl":
            from colibri.flights.fleet import sitl

            return sitl(args)
        if args.command == "replay":
            from colibri.flights.replay import replay

            return replay(args)
        if args.command == "verify" and args.golden is not None:
            from colibri.verification.golden import verify_golden

            return verify_golden(args)
        if args.command == "verify":
            from colibri.verification.verify import verify

            return verify(args)
        from colibri.bench.run import bench

        return bench(args)
    except KeyboardInterrupt:
        fail("interrupted", EXIT_INTERRUPTED)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="colibri", description="A quadrotor autopilot in pure Python, flown over MAVLink.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    add_fly_options(commands.add_parser("fly", help="fly a track and report how well it went"))
    add_sitl_options(
        commands.add_parser("sitl", help="stand ready for ground stations: QGroundControl, MAVSDK, MAVProxy")
    )
    add_figures_options(commands.add_parser("figures", help="fly all that the thesis shows and draw its figures"))
    add_compare_options(commands.add_parser("compare", help="fly several controllers on several tracks, side by side"))
    add_study_options(commands.add_parser("study", help="fly what shows how far profile flight reaches, and draw it"))
    add_bench_options(commands.add_parser("bench", help="measure how fast it flies"))
    add_replay_options(
        commands.add_parser("replay", help="feed a recorded flight to the autopilot: are its answers the same?")
    )
    add_verify_options(
        commands.add_parser(
            "verify", help="fly a fixed set of flights: is every bit the same, twice, or as it once was?"
        )
    )
    for name, what in PROCESSES.items():
        commands.add_parser(name, help=what, add_help=False)
    return parser
