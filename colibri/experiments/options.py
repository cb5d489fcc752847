"""The options of a flight: of the command line, and the same as keywords of Python."""

from argparse import Namespace
from collections.abc import Mapping
from functools import cache
from typing import Any, NoReturn

from colibri.autopilot.process.options import add_delay
from colibri.common.errors import Error, nearest
from colibri.common.process.arguments import ArgumentParser, natural, number, positive, speed
from colibri.flights.command_lines import options_of
from colibri.mavlink.hil.feedback import Feedback, feedback
from colibri.plant.process.options import add_world_arguments

TRACK_HELP = (
    "the thesis's spiral, expanding-spiral, line, wave or crown; or, with options as KEY=VALUE[,KEY=VALUE...], "
    "hover[:x=0,y=0,height=2,yaw=0], lemniscate[:size=4,height=3,lap=6,yaw=path|fixed], "
    "circle[:radius=2,speed=2,height=2,yaw=path|fixed], waypoints:FILE[,speed=2|max,margin=0.1], "
    "samples:FILE; m, s, degrees"
)


class OptionError(Error):
    """An option that there is not, or a value that it does not take."""


class _Keywords(ArgumentParser):
    """Reads what Python was given; what the command line would end with is raised."""

    def error(self, message: str) -> NoReturn:
        raise OptionError(message)


def add_feedback(parser: ArgumentParser) -> None:
    """Add what the autopilot flies by."""
    parser.add_argument(
        "--feedback",
        type=feedback,
        default=Feedback.STATE,
        metavar="state|sensors",
        help="what the autopilot flies by: the true state (default), or what sensors measure",
    )


def add_flight_options(parser: ArgumentParser) -> None:
    """Add what every command takes that flies: vehicles, solver, integrator, feedback, weather, chance, time."""
    add = parser.add_argument
    add("--seed", type=natural, default=0, metavar="N", help="seed of everything random (default %(default)s)")
    add_feedback(parser)
    add("--solver", metavar="NAME", help="QP solver of qpsolvers (default: the profile's)")
    add_delay(add)
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--plant-vehicle", metavar="NAME", help="another vehicle for the plant alone, to fly what was not planned for")
    add("--floor", type=number, metavar="M", help="no track may lead below this height, m (default: the ground, 0)")
    add("--integrator", choices=("rk4", "adaptive"), help="of the plant (default: the profile's)")
    add_world_arguments(
        parser, start="the profile's, and the track's first yaw", of_whom=" of the plant; the autopilot keeps its own"
    )
    add("--duration", type=positive, default=100.0, metavar="S", help="simulated time (default %(default)s)")


def add_plan_options(parser: ArgumentParser, link: str) -> None:
    """Add what one flight is planned by; it goes over `link` unless another is named."""
    add = parser.add_argument
    add("track", metavar="TRACK", help=TRACK_HELP)
    add("--profile", default="flight", metavar="NAME", help="control profile name or .toml (default %(default)s)")
    add("--controller", metavar="NAME", help="control law, also of another package (default: the profile's)")
    add(
        "--link",
        default=link,
        choices=("udp", "memory", "direct"),
        help="udp: two processes; memory: one process, same codec, same flight; direct: without the codec "
        "(default %(default)s)",
    )
    add("--speed", type=speed, metavar="N", help="times real time, or max (default: max; 1 with --gcs)")
    add_flight_options(parser)


def option_names() -> list[str]:
    """Return the names of the options of a flight, in alphabetical order; its track is one."""
    return sorted(_defaults("spiral"))


def read_keywords(track: str, keywords: Mapping[str, Any]) -> Namespace:
    """Return what the command line would read of the same options; in memory unless a link is named.

    Values are those of Python, or texts as the command line has them: `wind="5@270"`, `start={"x": 1.0}`.

    Raises:
        OptionError: There is no such option, or it does not take this value.
    """
    defaults = _defaults(track)
    for name in keywords.keys() - defaults.keys():
        hint = nearest(name, defaults) or f"choose {', '.join(sorted(defaults.keys() - {'track'}))}"
        raise OptionError(f"unknown option {name}: {hint}")
    return _parser().parse_args([*options_of(**keywords), "--", track])


def _defaults(track: str) -> dict[str, Any]:
    return vars(_parser().parse_args(["--", track]))


@cache
def _parser() -> _Keywords:
    parser = _Keywords(prog="colibri.fly", add_help=False, allow_abbrev=False)
    add_plan_options(parser, link="memory")
    return parser
