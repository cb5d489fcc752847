"""`colibri compare`."""

from argparse import Namespace

from colibri.analysis.limits import NONE_LOST
from colibri.cli.shared.options import add_gate, add_junit, add_out
from colibri.common.process.arguments import ArgumentParser, seeds
from colibri.common.spec import add_options as add_spec
from colibri.flights.spec import FlightSpec


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    parser.several(
        "--profile",
        "NAME[:CONTROLLER]",
        "a profile, or another controller with it",
        "thesis, thesis-euler, thesis:global-lpv-mpc, se3",
    )
    parser.several("--track", "TRACK", "a track", "the thesis's five")
    parser.several("--controller", "NAME", "control law of every profile given without one", "its own")
    add("--seeds", "FIRST-LAST", "fly each with all of these seeds, and show the spread of errors", type=seeds)
    parser.flag("--resume", "reuse flights in --out with the same contents")
    add_spec(parser, FlightSpec, leave_out=("track", "profile", "controller", "speed"), keywords_only=True)
    add_gate(parser, NONE_LOST)
    add_junit(parser)
    add_out(parser, "out/compare", "the tables")


def run(args: Namespace) -> int:
    from colibri.common.process.lifecycle import one_line
    from colibri.flights.folder import occupied

    with occupied(args.out), one_line():
        if args.seeds:
            from colibri.studies.seeds import compare_seeds

            return compare_seeds(args)
        from colibri.studies.comparison import compare

        return compare(args)
