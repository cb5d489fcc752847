"""`colibri arena`."""

from argparse import Namespace

from colibri.cli.shared.options import add_engine, add_gate, add_junit, add_out
from colibri.common.process.arguments import ArgumentParser


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add("sets", "SET", "race, race-told, robust, policy, planning, or a FILE.toml of your own", nargs="+")
    parser.several(
        "--law",
        "LAW",
        "a profile, or another controller with it, PROFILE:CONTROLLER; a controller; or FILE.py[:CLASS]",
        "agile, flight, se3",
    )
    add("--starts", "N", "starts a millimetre apart, 1 to 7, of which the worst counts", type=int, default=5)
    add_engine(parser)
    parser.flag("--resume", "continue the sets in --out")
    add_gate(parser, None)
    add_junit(parser)
    add_out(parser, "out/arena", "the tables and the figure of each set")


def run(args: Namespace) -> int:
    from colibri.arena.run import arena
    from colibri.common.process.lifecycle import one_line

    with one_line(kept=f"; finished flights are in {args.out}: continue with --resume"):
        return arena(args)
