"""`colibri bench`."""

from argparse import Namespace
from pathlib import Path

from colibri.common.process.arguments import ArgumentParser, positive


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    parser.several(
        "--only",
        "PART",
        "stages: each stage of a control step; flights: times real time at several rates; sensors: the "
        "estimator, and flights on sensors beside those on the state; simulators: the plant answering PX4 and "
        "ArduPilot; ground: serving ground stations, and the control step beside it; commands: whole ones, "
        "beside their goals",
        "all",
        choices=("stages", "flights", "sensors", "simulators", "ground", "commands"),
    )
    add("--runs", "N", "flights of each kind (default 3)", type=int, default=3, choices=range(1, 101))
    add("--duration", "S", "simulated time of a flight, but of the thesis's spiral", type=positive, default=10.0)
    against = "another checkout that is set up: have it run the whole commands in turn with this one"
    add("--against", "FOLDER", against, type=Path)
    add("--out", "FILE", "write the figures as JSON there", type=Path)


def run(args: Namespace) -> int:
    from colibri.bench.run import bench

    return bench(args)
