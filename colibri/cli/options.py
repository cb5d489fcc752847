"""The options of each subcommand, in a function of its name."""

from argparse import SUPPRESS, ArgumentTypeError
from math import inf
from pathlib import Path
from typing import Any

from colibri.analysis.limits import NONE_LOST, LossLimit, limit, loss_limit
from colibri.common.process.arguments import ArgumentParser, natural, positive
from colibri.common.process.arguments import seeds as seeds_of

GCS = "udpout:127.0.0.1:14550"
GOLDEN_HASHES = Path("tests/golden/hashes.json")
SHELLS = ("bash", "zsh", "fish", "tcsh", "powershell")


def fly(parser: ArgumentParser) -> None:
    start = "the profile's, and the track's first yaw"
    _flight(parser, defaults={"link": "udp"}, shown={"start": start})
    _view(parser)
    parser.flag("--quiet", "print errors only")
    _gate(parser, NONE_LOST)
    parser.flag("--no-figures", "draw no PNG figures")


def sitl(parser: ArgumentParser) -> None:
    from colibri.common.spec import add_options
    from colibri.flights.fleet_spec import FleetSpec

    shown = {
        "gcs": "udpout:127.0.0.1:14550, and udpout:127.0.0.1:14540 + N or, as ardupilot, tcpin:127.0.0.1:5760 + 10 N",
        "start": "standing at home",
    }
    add_options(parser, FleetSpec, leave_out=("floor",), shown=shown)
    _view(parser)
    parser.flag("--quiet", "print errors only")


def view(parser: ArgumentParser) -> None:
    add = parser.value
    add(
        "what",
        "FOLDER|LINK",
        "flights by their folders, written by `colibri fly` (several are shown together); or a link to a "
        "MAVLink vehicle: udpin:, udpout:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD",
        nargs="+",
    )
    add("--port", "N", "of the page, on loopback (default: any that is free)", type=natural, default=0)
    add("--export", "FILE.html", "write flights as one file that plays them, and end", type=Path)
    parser.flag("--no-browser", "only print the page's address, alone on the first line")


def plot(parser: ArgumentParser) -> None:
    parser.value("folder", "DIR", "as `colibri fly` leaves it, however the flight ended", type=Path)
    parser.flag("--quiet", "print errors only")


def export(parser: ArgumentParser) -> None:
    parser.value("log", "DIR|FILE.ulg", "a flight by its folder, or any ULog, PX4's too", type=Path)
    parser.flag("--mcap", "write flight.mcap beside it, for Foxglove")
    parser.flag("--csv", "write flight-topics/*.csv beside it, a table of each topic")
    parser.flag("--mat", "write flight.mat beside it, a struct of each topic, for MATLAB and Octave")
    parser.flag("--parquet", "write flight-topics/*.parquet beside it, a table of each topic")
    parser.flag("--quiet", "print errors only")


def replay(parser: ArgumentParser) -> None:
    parser.value("log", "DIR|FLIGHT.ULG", "folder of a flight, or its flight.ulg", type=Path)
    parser.flag("--quiet", "print errors only")


def campaign(parser: ArgumentParser) -> None:
    add = parser.value
    add("file", "FILE.toml", "the campaign; options take precedence over it", nargs="?", type=Path)
    add("--track", "TRACK", "a track; may be repeated: each is flown", dest="tracks", action="append")
    parser.several(
        "--set",
        "KEY=VALUES",
        "a factor and its values, A,B,C or FIRST:LAST:COUNT: an option of a flight, or a number of profile., "
        "vehicle. or plant-vehicle. by its dotted key; KEY* multiplies what the file has",
        dest="settings",
    )
    parser.several(
        "--draw",
        "KEY=DISTRIBUTION",
        "a factor drawn for each flight: uniform:LOW:HIGH, log-uniform:LOW:HIGH, normal:MEAN:DEVIATION or choice:A,B,C",
        dest="draws",
    )
    add("--seeds", "FIRST-LAST", "every combination is flown by each (default 0)", default=SUPPRESS)
    add("--root-seed", "N", "of the draws (default 0)", type=int, default=SUPPRESS)
    parser.add_argument("--name", default=SUPPRESS, help="in titles (default: the file's)")
    add("--metrics", "A,B", "numbers of report.json to keep (default: the usual)", default=SUPPRESS)
    parser.add_argument(
        "--logs", default=SUPPRESS, choices=("none", "lost", "all"), help="flights whose logs are kept (default none)"
    )
    _engine(parser)
    parser.flag("--resume", "continue the campaign in --out")
    parser.flag("--parquet", "write flights.parquet, too")
    parser.flag("--yes", "also if it has more than a million flights")
    _flight(parser, leave_out=("track", "seed", "speed", "params"), given_only=True, keywords_only=True)
    _gate(parser, None, junit=True)
    _out(parser, "out/campaign", "table, summary, figure and journal")


def tune(parser: ArgumentParser) -> None:
    add = parser.value
    add("file", "FILE.toml", "the tuning; options take precedence over it", type=Path)
    add("--trials", "N", "how many, the profile as it is among them", type=int, default=SUPPRESS)
    add("--seeds", "FIRST-LAST", "seeds of each trial", default=SUPPRESS)
    add("--check-seeds", "FIRST-LAST", "seeds of the validation, which no trial flies", default=SUPPRESS)
    add("--root-seed", "N", "seed of the search and of draws", type=int, default=SUPPRESS)
    add("--prune-after", "N", "seeds between two decisions to stop a trial; 0: never stop", type=int, default=SUPPRESS)
    parser.add_argument("--name", default=SUPPRESS, help="in titles (default: the file's)")
    _engine(parser)
    parser.flag("--resume", "continue the tuning in --out, or join running processes")
    _out(parser, "out/tune", "profile, tables, figures and journal")


def compare(parser: ArgumentParser) -> None:
    parser.several(
        "--profile",
        "NAME[:CONTROLLER]",
        "a profile, or another controller with it",
        "thesis, thesis-euler, thesis:global-lpv-mpc, se3",
    )
    parser.several("--track", "TRACK", "a track", "the thesis's five")
    parser.several("--controller", "NAME", "control law of every profile given without one", "its own")
    seeds = "fly each with all of these seeds, and show the spread of errors"
    parser.value("--seeds", "FIRST-LAST", seeds, type=seeds_of)
    parser.flag("--resume", "reuse flights in --out with the same contents")
    _flight(parser, leave_out=("track", "profile", "controller", "speed"), keywords_only=True)
    _gate(parser, NONE_LOST, junit=True)
    _out(parser, "out/compare", "the tables")


def arena(parser: ArgumentParser) -> None:
    add = parser.value
    add("sets", "SET", "race, race-told, robust, policy, planning, or a FILE.toml of your own", nargs="+")
    parser.several(
        "--law",
        "LAW",
        "a profile, or another controller with it, PROFILE:CONTROLLER; a controller; or FILE.py[:CLASS]",
        "agile, flight, se3",
    )
    add("--starts", "N", "starts a millimetre apart, 1 to 7, of which the worst counts", type=int, default=5)
    _engine(parser)
    parser.flag("--resume", "continue the sets in --out")
    _gate(parser, None, junit=True)
    _out(parser, "out/arena", "the tables and the figure of each set")


def study(parser: ArgumentParser) -> None:
    names = "tracks, speed, recovery, robustness or limits (default: all of them)"
    parser.value("names", "NAME", names, nargs="*")
    _out(parser, "out/study", "figures and tables")


def figures(parser: ArgumentParser) -> None:
    _out(parser, "out/thesis", "PNG and SVG")
    parser.several("--only", "NUMBER", "only this figure, for example 4.9", default=None)


def companion(parser: ArgumentParser) -> None:
    from colibri.flights.spec import TRACK_HELP

    add = parser.value
    mission = "or FILE.plan, a mission of QGroundControl: its waypoints, from the vehicle's home"
    hover = "what hover leaves out is as the vehicle has it"
    add("track", "TRACK", f"{TRACK_HELP}; {mission}; {hover}", nargs="?")
    reached = "how the vehicle is reached: udpin:, udpout:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD"
    add("--vehicle", "URL", reached, required=True)
    add("--system", "ID", "MAVLink system id, where several are on the link", type=natural, default=0)
    add("--model", "NAME", "vehicle name or .toml that describes it (default: the profile's)")
    add("--profile", "NAME", "control profile name or .toml", default="flight")
    add("--controller", "NAME", "control law, also of another package (default: the profile's)")
    parser.flag("--arm", "arm and take off; without it a vehicle that flies is taken over")
    parser.flag("--dry-run", "ask, compute and log, but send neither setpoints nor orders")
    parser.flag("--identify", "hover, and measure in small steps how body rates follow commands")
    add("--response", "FILE", "companion.toml of an earlier --identify")
    stacks = ("px4", "ardupilot", "colibri")
    parser.add_argument("--stack", choices=stacks, help="autopilot of the vehicle (default: as in its heartbeat)")
    parser.add_argument(
        "--setpoints",
        default="rates",
        choices=("rates", "attitude", "velocity", "position"),
        help="setpoints to send; the last three for vehicles that accept no body rates (default %(default)s)",
    )
    add("--duration", "S", "time along the track (default: all of it)", type=positive, default=inf)
    add("--height", "M", "of the take-off (default: that of the track's first point)", type=positive)
    add("--wait", "S", "for vehicle and checks (default %(default)g)", type=positive, default=60.0)
    add("--margin", "M", "of the box around the track (default %(default)g)", type=positive, default=3.0)
    add("--max-tilt", "DEG", "ends the flight (default %(default)g)", type=positive, default=50.0)
    add("--max-error", "M", "from the reference (default %(default)g)", type=positive, default=1.5)
    add("--max-age", "MS", "of the newest state; ends the flight (default %(default)g)", type=positive, default=100.0)
    pace = "of the setpoints over a second, by a computer that keeps up; fewer end the flight (default %(default)g)"
    add("--min-pace", "PERCENT", pace, type=positive, default=80.0)
    add("--max-gap", "MS", "between two setpoints; ends the flight (default %(default)g)", type=positive, default=200.0)
    key = "sign messages, and refuse messages without a signature of this key"
    add("--signing-key", "FILE", key, type=Path)
    parser.flag("--insecure", "let links leave this computer without a key")
    _out(parser, "out/companion", "logs and report")


def vehicle(parser: ArgumentParser) -> None:
    add = parser.value
    add("name", "NAME", "vehicle name or .toml; or new: write the file of a new vehicle")
    add("new_name", "NEW", "of new: its name", nargs="?")
    loaded_by = "px4: a file that QGroundControl loads; ardupilot: one that SITL, MAVProxy and Mission Planner load"
    parser.add_argument("--for", choices=("px4", "ardupilot"), dest="whom", help=loaded_by)
    add("--out", "FILE", "where to write (default: standard output; of new, NEW.toml)", type=Path)
    add("--mass", "KG", "of new: ready to fly, with battery", type=float)
    add("--arm", "M", "of new: from the centre to a motor", type=float)
    add("--wheelbase", "M", "of new: from motor to opposite motor, in place of --arm", type=float)
    layouts = "x, + or h (x, turning the other way), hexa-x, hexa-+, octo-x, octo-+, x8 or y6"
    add("--layout", "NAME", f"of new: {layouts} (default x)", default="x")
    order = "of new: order of the rotors; clockwise: from the front (right) on (default px4, as ArduPilot's)"
    parser.add_argument("--order", choices=("px4", "clockwise"), default="px4", help=order)
    add("--propeller", "SIZE", "of new: inches as 10x4.5 or 1045, or millimetres as 45mm")
    parser.add_argument(
        "--motor", choices=("brushless", "brushed"), help="of new: required for one cell and below 60 mm"
    )
    add("--kv", "RPM/V", "of new: the motors' speed constant", type=float)
    add("--cells", "N", "of new: lithium cells in series", type=int)
    add("--capacity", "AH", "of new: of the battery, which is then modelled", type=float)
    add("--hover-throttle", "PART", "of new: of the largest thrust, as in MPC_THR_HOVER or MOT_THST_HOVER", type=float)
    add("--thrust-stand", "FILE", "of new: CSV with throttle, thrust_g, speed_rpm, current_a", type=Path)
    add("--lag", "S", "of new: measured time constant of the rotors", type=float)
    add("--inertia", "X,Y,Z", "of new: measured moments of inertia, kg m²")
    add("--drag", "N_S_M", "of new: measured horizontal drag, N for each m/s", type=float)
    parser.flag("--force", "of new: overwrite the file")


def check_controller(parser: ArgumentParser) -> None:
    add = parser.value
    add("name", "NAME", "control law, also of another package")
    add("--profile", "NAME", "control profile name or .toml (default: the one with numbers for the law)")
    add("--vehicle", "NAME", "vehicle name or .toml (default: the profile's)")
    add("--seed", "N", "seed of everything random (default %(default)s)", type=natural, default=0)
    add("--duration", "S", "simulated time to fly each of the thesis's tracks", type=positive, default=30.0)
    parser.several("--only", "AREA", "try only this: interface, memory, limits, optional, time, flights or restart")
    parser.flag("--quiet", "print failed checks only")


def gym(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("action", choices=["export"], help="write POLICY.toml beside a policy")
    add("policy", "POLICY.onnx", "a model from observations, (1, n), to actions, (1, a)", type=Path)
    add("--env", "NAME", "where it has learned", default="colibri/Hover-v0")
    parser.several("--set", "KEY=VALUE", "a keyword of the environment", type=_keyword)


def certify(parser: ArgumentParser) -> None:
    add = parser.value
    add("profile", "PROFILE", "control profile name or .toml")
    add("--controller", "NAME", "control law that the profile has numbers for (default: its own)")
    add("--vehicle", "NAME", "vehicle name or .toml (default: the profile's)")
    add("--moment", "NM", "moment that disturbs, N m", type=positive, default=0.01)
    add("--charge", "PART", "part of the battery's charge that may be taken", type=_part, default=0.5)
    least = "refuse a law without Lyapunov function over this part of the profile's ranges"
    add("--least", "PART", least, type=_part, default=0.5)
    add("--flights", "N", "flights from the set's border", type=_some, default=1000)
    add("--seed", "N", "seed of the flights (default %(default)s)", type=natural, default=0)
    _out(parser, "out/certify", "certificate, table and figure")


def show(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("what", choices=("profile", "vehicle", "law"), help="what to show")
    add("name", "NAME", "name of one that comes with Colibri; any other name lists them", nargs="?")
    add("--vehicle", "NAME", "of law: the vehicle from which its numbers follow (default: the profile's)")
    add("--profile", "NAME", "of law: the profile", default="flight")
    add("--controller", "NAME", "of law: the control law (default: the profile's)")


def compile(parser: ArgumentParser) -> None:
    parser.add_argument("what", nargs="*", help="flight, thesis, sensors, path, tests (default all of them)")
    parser.flag("--quiet", "print errors only")


def doctor(parser: ArgumentParser) -> None:
    parser.value(
        "--gcs",
        "URL",
        "call a ground station as a vehicle does, and wait for its heartbeat: "
        f"udpout:, udpin:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD (default {GCS})",
        nargs="?",
        const=GCS,
    )
    parser.value("--within", "S", "how long to wait for it", type=positive, default=10.0)


def bench(parser: ArgumentParser) -> None:
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


def verify(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("--link", default="udp", choices=("udp", "memory"), help="of the flights (default %(default)s)")
    add("--duration", "S", "simulated time of each flight (default 20; golden: its own)", type=positive)
    add(
        "--golden",
        "FILE",
        "fly the golden flights instead, once each, and compare their hashes with those in FILE "
        f"(default {GOLDEN_HASHES})",
        type=Path,
        nargs="?",
        const=GOLDEN_HASHES,
    )
    parser.flag("--renew", "with --golden: write the hashes to FILE, and show which have changed")
    parser.several("--only", "NAME", "with --golden: only this flight")
    _out(parser, "out/verify", "the logs")


def completion(parser: ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="whose; where the script goes is in the examples")


def _flight(parser: ArgumentParser, **how: Any) -> None:
    from colibri.common.spec import add_options
    from colibri.flights.spec import FlightSpec

    add_options(parser, FlightSpec, **how)


def _view(parser: ArgumentParser) -> None:
    parser.flag("--view", "show it in a browser as it flies; the page's address is the first line")


def _engine(parser: ArgumentParser) -> None:
    parser.value("--workers", "N", "processes (default: one a core)", type=int)
    parser.value("--dask", "ADDRESS", "fly on a cluster: address of its Dask scheduler, for example tcp://HOST:8786")


def _gate(parser: ArgumentParser, lost: LossLimit | None, *, junit: bool = False) -> None:
    """Add what continuous integration needs; `lost` is the default of `--fail-lost`."""
    parser.several(
        "--fail-above",
        "[KEY=]VALUE",
        "exit with 1 if a number of report.json is larger: rmse_after_20s_m (m), or another by its KEY, for "
        "example ground_contact_s=0",
        type=limit,
    )
    parser.value(
        "--fail-lost",
        "N|P%",
        "exit with 1 if more flights are lost or refused, a number or a share of all "
        f"(default: {'if all are' if lost is None else '0'})".replace("%", "%%"),
        type=loss_limit,
        default=lost,
    )
    parser.flag("--json", "print the result as JSON, and nothing else, on standard output")
    if junit:
        parser.value("--junit", "FILE", "write JUnit XML, one test case a flight", type=Path)


def _out(parser: ArgumentParser, folder: str, what: str) -> None:
    parser.value("--out", "DIR", f"folder for {what}", type=Path, default=Path(folder))
    parser.flag("--quiet", "print errors only")


def _part(text: str) -> float:
    value = positive(text)
    if value > 1.0:
        raise ArgumentTypeError(f"must be a part of 1, not {text}")
    return value


def _some(text: str) -> int:
    value = natural(text)
    if value == 0:
        raise ArgumentTypeError("must be at least 1")
    return value


def _keyword(text: str) -> tuple[str, Any]:
    import msgspec

    name, equals, value = text.partition("=")
    if not equals or not name:
        raise ArgumentTypeError(f'must be KEY=VALUE, "action=rates" say, not "{text}"')
    try:
        return name, msgspec.json.decode(value)
    except msgspec.DecodeError:
        return name, value
