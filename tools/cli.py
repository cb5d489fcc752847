"""`colibri`: the one command. Loads only what the subcommand needs."""

import signal
import threading
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable
from math import inf
from pathlib import Path

from mavlink.feedback import Feedback, feedback
from mavlink.home import DEFAULT_HOME, home
from mavlink.process import EXIT_INTERRUPTED, ArgumentParser, fail, natural, positive, speed, use_one_thread
from plant.scenario import LATENCY_HELP, add_world_arguments, latency
from plant.weather import NO_WIND, add_weather_arguments

COMPARED_S = 100.0
GOLDEN_HASHES = Path("tests/golden/hashes.json")
TRACK_HELP = (
    "the thesis's spiral, expanding-spiral, line, wave or crown; or, with options as KEY=VALUE[,KEY=VALUE...], "
    "hover[:x=0,y=0,height=2,yaw=0], lemniscate[:size=4,height=3,lap=6,yaw=path|fixed], "
    "circle[:radius=2,speed=2,height=2,yaw=path|fixed], waypoints:FILE[,speed=2]; m, s, degrees"
)


def main(argv: list[str] | None = None) -> int:
    """Run a subcommand; return the exit code."""
    args = _parser().parse_args(argv)
    use_one_thread()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that what was started is ended, too
    try:
        if args.command == "fly":
            from tools.fly import fly

            return fly(args)
        if args.command == "figures":
            from tools.thesis_figures import figures

            return figures(args)
        if args.command == "compare" and _in_another_world(args):
            from tools.seeds import compare_seeds

            return compare_seeds(args)
        if args.command == "compare":
            from tools.compare import compare

            return compare(args)
        if args.command == "study":
            from tools.studies import study

            return study(args)
        if args.command == "sitl":
            from tools.sitl import sitl

            return sitl(args)
        if args.command == "replay":
            from tools.replay import replay

            return replay(args)
        if args.command == "verify" and args.golden is not None:
            from tools.golden import verify_golden

            return verify_golden(args)
        if args.command == "verify":
            from tools.verify import verify

            return verify(args)
        from tools.bench import bench

        return bench(args)
    except KeyboardInterrupt:
        fail("interrupted", EXIT_INTERRUPTED)


def _in_another_world(args: Namespace) -> bool:
    """Whether the comparison leaves the thesis's world: chance, sensors, weather, another vehicle, two processes."""
    weather = args.wind is not NO_WIND or args.gust or args.turbulence
    chance = args.seeds or args.feedback is Feedback.SENSORS
    return bool(args.resume or chance or weather or args.vehicle or args.link == "udp" or args.duration != COMPARED_S)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="colibri", description="A quadrotor autopilot in pure Python, flown over MAVLink.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_fly(commands.add_parser("fly", help="fly a track and report how well it went"))
    _add_sitl(commands.add_parser("sitl", help="stand ready for ground stations: QGroundControl, MAVSDK, MAVProxy"))
    _add_figures(commands.add_parser("figures", help="fly all that the thesis shows and draw its figures"))
    _add_compare(commands.add_parser("compare", help="fly several controllers on several tracks, side by side"))
    _add_study(commands.add_parser("study", help="fly what shows how far profile flight reaches, and draw it"))
    _add_bench(commands.add_parser("bench", help="measure how fast it flies"))
    _add_replay(
        commands.add_parser("replay", help="feed a recorded flight to the autopilot: are its answers the same?")
    )
    _add_verify(
        commands.add_parser(
            "verify", help="fly a fixed set of flights: is every bit the same, twice, or as it once was?"
        )
    )
    return parser


def _add_fly(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("track", metavar="TRACK", help=TRACK_HELP)
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law, also of another package (default: the profile's)")
    add(
        "--link",
        default="udp",
        choices=("udp", "memory", "direct"),
        help="udp: two processes (default); memory: one process, same codec, same flight; direct: without the codec",
    )
    add(
        "--gcs",
        action="append",
        default=[],
        metavar="URL",
        help="a ground station that may watch and command: udpout:, udpin:, tcp: or tcpin:HOST:PORT; may be repeated",
    )
    _add_signing(add)
    add(
        "--speed",
        type=speed,
        metavar="N",
        help="times real time, or max (default: max; 1 where a ground station is invited by --gcs)",
    )
    add("--seed", type=natural, default=0, metavar="N", help="seed of everything random (default %(default)s)")
    _add_feedback(add)
    add("--latency", type=latency, default=0.0, metavar="MS", help=f"between plant and autopilot, {LATENCY_HELP}")
    add("--solver", metavar="NAME", help="QP solver of qpsolvers (default: the profile's)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--plant-vehicle", metavar="NAME", help="another vehicle for the plant alone, to fly what was not planned for")
    add("--integrator", choices=("rk4", "adaptive"), help="of the plant (default: the profile's)")
    add_world_arguments(
        parser, start="the profile's, and the track's first yaw", of_whom=" of the plant; the autopilot keeps its own"
    )
    add("--duration", type=positive, default=100.0, metavar="S", help="simulated time (default %(default)s)")
    add(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="folder for logs and figures (default %(default)s)"
    )
    add("--quiet", action="store_true", help="say nothing but errors")
    add("--no-figures", action="store_true", help="draw no PNG figures")


def _add_sitl(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--instance", type=natural, default=0, metavar="N", help="number of the (first) vehicle: its system id is N + 1"
    )
    add("--count", type=natural, default=1, metavar="N", help="how many vehicles (default 1)")
    add(
        "--home",
        type=home,
        default=DEFAULT_HOME,
        metavar="LAT,LON,ALT,YAW",
        help="where they stand, degrees and m, yaw clockwise from north (default Zurich: %(default)s)",
    )
    add("--identity", default="px4", choices=("px4", "generic"), help="what they say they are (default %(default)s)")
    add(
        "--gcs",
        action="append",
        default=[],
        metavar="URL",
        help="a ground station to call or to wait for: udpout:, udpin:, tcp: or tcpin:HOST:PORT; may be repeated "
        "(default: udpout:127.0.0.1:14550, and udpout:127.0.0.1:14540 + N)",
    )
    _add_signing(add)
    add(
        "--state",
        type=Path,
        default=Path("out/sitl"),
        metavar="DIR",
        help="for parameters and logs (default %(default)s)",
    )
    add(
        "--out",
        type=Path,
        metavar="DIR",
        help="record in DIR/N what `colibri replay` flies again: both processes' logs (default: not)",
    )
    add("--plant-port", type=int, metavar="PORT", help="the plant's (default: 14560 + N; 0: any that is free)")
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law, also of another package (default: the profile's)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--plant-vehicle", metavar="NAME", help="another vehicle for the plant alone, to fly what was not planned for")
    add_world_arguments(parser, start="standing at home")
    _add_feedback(add)
    add("--seed", type=natural, default=0, metavar="N", help="of everything random; each vehicle adds its number")
    add("--speed", type=speed, default=1.0, metavar="N", help="times real time, or max (default 1)")
    add("--duration", type=positive, default=inf, metavar="S", help="end after this simulated time (default: never)")
    add("--quiet", action="store_true", help="say nothing but errors")


def _add_replay(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("tlog", type=Path, metavar="FLIGHT.TLOG", help="as `colibri fly` leaves it, with inputs.jsonl beside it")
    add("--quiet", action="store_true", help="say nothing but errors")


def _add_verify(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("--link", default="udp", choices=("udp", "memory"), help="of the flights (default %(default)s)")
    add("--duration", type=positive, metavar="S", help="simulated time of each flight (default 20; golden: its own)")
    add(
        "--golden",
        type=Path,
        nargs="?",
        const=GOLDEN_HASHES,
        metavar="FILE",
        help="fly the golden flights instead, once each, and compare their hashes with those in FILE "
        f"(default {GOLDEN_HASHES})",
    )
    add("--renew", action="store_true", help="with --golden: write the hashes to FILE, and show which have changed")
    add("--only", action="append", default=[], metavar="NAME", help="with --golden: only this flight; may be repeated")
    add("--out", type=Path, default=Path("out/verify"), metavar="DIR", help="folder for the logs (default %(default)s)")
    add("--quiet", action="store_true", help="say nothing but errors")


def seeds(text: str) -> range:
    """Read FIRST-LAST of the command line."""
    first, _, last = text.partition("-")
    try:
        chosen = range(int(first), int(last or first) + 1)
    except ValueError:
        chosen = range(0)
    if not chosen:
        raise ArgumentTypeError(f"expected FIRST-LAST, 1-50 say, not {text}")
    return chosen


def _add_feedback(add: Callable[..., object]) -> None:
    add(
        "--feedback",
        type=feedback,
        default=Feedback.STATE,
        metavar="state|sensors",
        help="what the autopilot flies by: the true state (default), or what sensors measure",
    )


def _add_signing(add: Callable[..., object]) -> None:
    add("--signing-key", type=Path, metavar="FILE", help="sign what is sent, refuse what is not signed with this key")
    add("--insecure", action="store_true", help="let links leave this computer without a key")


def _add_figures(parser: ArgumentParser) -> None:
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


def _add_compare(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--profile",
        action="append",
        metavar="NAME[:CONTROLLER]",
        help="a profile, or another controller with it; may be repeated (default: thesis, thesis-euler, "
        "thesis:global-lpv-mpc, se3)",
    )
    add("--track", action="append", metavar="TRACK", help="a track; may be repeated (default: the thesis's five)")
    add(
        "--link",
        default="memory",
        choices=("memory", "direct", "udp"),
        help="one process, with or without the codec; or two (default %(default)s)",
    )
    add("--seeds", type=seeds, metavar="FIRST-LAST", help="fly each by all of these seeds, and show how errors spread")
    add("--resume", action="store_true", help="with --seeds: do not fly again what --out has already")
    _add_feedback(add)
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--duration", type=positive, default=COMPARED_S, metavar="S", help="simulated time (default %(default)s)")
    add_weather_arguments(parser)
    add(
        "--out",
        type=Path,
        default=Path("out/compare"),
        metavar="DIR",
        help="folder for the tables (default %(default)s)",
    )
    add("--quiet", action="store_true", help="say nothing but errors")


def _add_study(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "names",
        nargs="*",
        metavar="NAME",
        help="tracks, speed, recovery, robustness, limits or scheduling (default: all of them)",
    )
    add(
        "--out",
        type=Path,
        default=Path("out/study"),
        metavar="DIR",
        help="folder for figures and tables (default %(default)s)",
    )
    add("--quiet", action="store_true", help="say nothing but errors")


def _add_bench(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--only",
        action="append",
        choices=("stages", "flights", "sensors", "ground", "thesis"),
        help="stages: each stage of a control step; flights: times real time at several rates, beside RotorPy if it is "
        "installed; sensors: the estimator, and flights on sensors beside those on the state; ground: serving ground "
        "stations, and the control step beside it; thesis: its spiral through the whole command; may be repeated "
        "(default: all)",
    )
    add("--runs", type=int, default=3, choices=range(1, 101), metavar="N", help="flights of each kind (default 3)")
    add(
        "--duration",
        type=positive,
        default=10.0,
        metavar="S",
        help="simulated time of a flight, but of the spiral's (default %(default)s)",
    )
    add("--out", type=Path, metavar="FILE", help="write the figures as JSON there")
