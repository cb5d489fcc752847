"""The options of each subcommand, in a function of its name."""

from argparse import SUPPRESS
from math import inf
from pathlib import Path
from typing import Any

from colibri.analysis.limits import NONE_LOST, LossLimit, limit, loss_limit
from colibri.common.process.arguments import ArgumentParser, counting, keyword, natural, part, positive
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
        "folders of flights, shown together; or the link to a live MAVLink vehicle: udpin:, udpout:, tcp: or "
        "tcpin:HOST:PORT, or serial:DEVICE:BAUD",
        nargs="+",
    )
    add("--port", "N", "port of the page, on loopback (default: any free one)", type=natural, default=0)
    add("--export", "FILE.html", "write the flights as one HTML file that plays them, and exit", type=Path)
    parser.flag("--no-browser", "open no browser; the first line printed is the page's address")


def plot(parser: ArgumentParser) -> None:
    parser.value("folder", "DIR", "folder of a flight, also of one that ended early", type=Path)
    parser.flag("--quiet", "print errors only")


def export(parser: ArgumentParser) -> None:
    parser.value("log", "DIR|FILE.ulg", "folder of a flight, or any ULog, also one of PX4", type=Path)
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
    add("file", "FILE.toml", "file of the campaign; options override it", nargs="?", type=Path)
    add("--track", "TRACK", "track to fly; may be repeated", dest="tracks", action="append")
    parser.several(
        "--set",
        "KEY=VALUES",
        "factor and its values, A,B,C or FIRST:LAST:COUNT: an option of a flight, or a key of a file after profile., "
        "vehicle. or plant-vehicle.; KEY* multiplies the number in the file",
        dest="settings",
    )
    parser.several(
        "--draw",
        "KEY=DISTRIBUTION",
        "random factor of each flight: uniform:LOW:HIGH, log-uniform:LOW:HIGH, normal:MEAN:DEVIATION or choice:A,B,C",
        dest="draws",
    )
    add("--seeds", "FIRST-LAST", "seeds of each combination (default 0)", default=SUPPRESS)
    add("--root-seed", "N", "seed of --draw (default 0)", type=int, default=SUPPRESS)
    parser.add_argument("--name", default=SUPPRESS, help="name in titles (default: the file's)")
    add("--metrics", "A,B", "numbers of report.json in the table (default: the most important)", default=SUPPRESS)
    parser.add_argument(
        "--logs", default=SUPPRESS, choices=("none", "lost", "all"), help="flights whose logs are kept (default none)"
    )
    _engine(parser)
    parser.flag("--resume", "continue the campaign in --out")
    parser.flag("--parquet", "also write flights.parquet")
    parser.flag("--yes", "allow more than a million flights")
    _flight(parser, leave_out=("track", "seed", "speed", "params"), given_only=True, keywords_only=True)
    _gate(parser, None, junit=True)
    _out(parser, "out/campaign", "table, summary, figure and journal")


def tune(parser: ArgumentParser) -> None:
    add = parser.value
    add("file", "FILE.toml", "file of the tuning; options override it", type=Path)
    add("--trials", "N", "number of trials; the first is the unchanged profile", type=int, default=SUPPRESS)
    add("--seeds", "FIRST-LAST", "seeds of each trial", default=SUPPRESS)
    add("--check-seeds", "FIRST-LAST", "seeds of the validation, not used by trials", default=SUPPRESS)
    add("--root-seed", "N", "seed of the search and of random factors", type=int, default=SUPPRESS)
    add("--prune-after", "N", "seeds between decisions to stop a trial; 0: never", type=int, default=SUPPRESS)
    parser.add_argument("--name", default=SUPPRESS, help="name in titles (default: the file's)")
    _engine(parser)
    parser.flag("--resume", "continue the tuning in --out, or join running processes")
    _out(parser, "out/tune", "profile, tables, figures and journal")


def compare(parser: ArgumentParser) -> None:
    parser.several(
        "--profile",
        "NAME[:CONTROLLER]",
        "profile, optionally with another control law",
        "thesis, thesis-euler, thesis:global-lpv-mpc, se3",
    )
    parser.several("--track", "TRACK", "track to fly", "the thesis's five")
    parser.several("--controller", "NAME", "control law of each --profile without CONTROLLER", "its own")
    seeds = "fly each with these seeds, and print the spread of errors"
    parser.value("--seeds", "FIRST-LAST", seeds, type=seeds_of)
    parser.flag("--resume", "reuse flights in --out with the same inputs")
    _flight(parser, leave_out=("track", "profile", "controller", "speed"), keywords_only=True)
    _gate(parser, NONE_LOST, junit=True)
    _out(parser, "out/compare", "the tables")


def arena(parser: ArgumentParser) -> None:
    add = parser.value
    add("sets", "SET", "race, race-told, robust, policy, planning, or your own FILE.toml", nargs="+")
    parser.several("--law", "LAW", "PROFILE, PROFILE:CONTROLLER, CONTROLLER or FILE.py[:CLASS]", "agile, flight, se3")
    add("--starts", "N", "number of starts, 1 mm apart, from 1 to 7; the worst result counts", type=int, default=5)
    _engine(parser)
    parser.flag("--resume", "continue the sets in --out")
    _gate(parser, None, junit=True)
    _out(parser, "out/arena", "the tables and the figure of each set")


def study(parser: ArgumentParser) -> None:
    names = "tracks, speed, recovery, robustness or limits (default: all)"
    parser.value("names", "NAME", names, nargs="*")
    _out(parser, "out/study", "figures and tables")


def figures(parser: ArgumentParser) -> None:
    _out(parser, "out/thesis", "PNG and SVG")
    parser.several("--only", "NUMBER", "only this figure, for example 4.9", default=None)


def companion(parser: ArgumentParser) -> None:
    from colibri.flights.spec import TRACK_HELP

    add = parser.value
    mission = "or FILE.plan, the waypoints of a QGroundControl mission, from the vehicle's home"
    hover = "hover without a key keeps the vehicle's present value"
    add("track", "TRACK", f"{TRACK_HELP}; {mission}; {hover}", nargs="?")
    reached = "link to the vehicle: udpin:, udpout:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD"
    add("--vehicle", "URL", reached, required=True)
    add("--system", "ID", "MAVLink system id, if the link has several vehicles", type=natural, default=0)
    add("--model", "NAME", "vehicle name or .toml that describes it (default: the profile's)")
    add("--profile", "NAME", "control profile name or .toml", default="flight")
    add("--controller", "NAME", "control law, built-in or of another package (default: the profile's)")
    parser.flag("--arm", "arm and take off (default: take over a flying vehicle)")
    parser.flag("--dry-run", "compute and log, but send neither setpoints nor commands")
    parser.flag("--identify", "hover, and measure the response of the body rates by small steps")
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
    add("--height", "M", "take-off height (default: that of the track's first point)", type=positive)
    limits = (
        ("--wait", "S", "longest time until the vehicle passes all checks", 60.0),
        ("--margin", "M", "margin of the box around the track; outside the flight ends", 3.0),
        ("--max-tilt", "DEG", "largest tilt; above it the flight ends", 50.0),
        ("--max-error", "M", "largest distance from the reference; above it the flight ends", 1.5),
        ("--max-age", "MS", "largest age of the newest state; above it the flight ends", 100.0),
        ("--min-pace", "PERCENT", "least share of due setpoints sent in a second; below it the flight ends", 80.0),
        ("--max-gap", "MS", "longest gap between setpoints; above it the flight ends", 200.0),
    )
    for name, unit, purpose, default in limits:
        add(name, unit, f"{purpose} (default %(default)g)", type=positive, default=default)
    key = "sign messages with this key, and refuse unsigned messages"
    add("--signing-key", "FILE", key, type=Path)
    parser.flag("--insecure", "allow links to other computers without a key")
    _out(parser, "out/companion", "logs and report")


def vehicle(parser: ArgumentParser) -> None:
    add = parser.value
    add("name", "NAME", "vehicle name or .toml; or new: write the file of a new vehicle")
    add("new_name", "NEW", "with new: name of the vehicle", nargs="?")
    loaded_by = "write parameters, px4: for QGroundControl; ardupilot: for SITL, MAVProxy and Mission Planner"
    parser.add_argument("--for", choices=("px4", "ardupilot"), dest="whom", help=loaded_by)
    add("--out", "FILE", "file to write (default: standard output; with new, NEW.toml)", type=Path)
    add("--mass", "KG", "with new: mass ready to fly, with battery", type=float)
    add("--arm", "M", "with new: distance from the centre to a motor", type=float)
    add("--wheelbase", "M", "with new: distance between opposite motors, instead of --arm", type=float)
    layouts = "x, + or h (x, turning the other way), hexa-x, hexa-+, octo-x, octo-+, x8 or y6"
    add("--layout", "NAME", f"with new: layout of the rotors, {layouts} (default x)", default="x")
    order = "with new: order of the rotors; clockwise: from the front or front right (default px4, as ArduPilot's)"
    parser.add_argument("--order", choices=("px4", "clockwise"), default="px4", help=order)
    add("--propeller", "SIZE", "with new: size in inches, 10x4.5 or 1045, or in millimetres, 45mm")
    parser.add_argument(
        "--motor", choices=("brushless", "brushed"), help="with new: required for one cell and below 60 mm"
    )
    add("--kv", "RPM/V", "with new: speed constant of the motors", type=float)
    add("--cells", "N", "with new: number of lithium cells in series", type=int)
    add("--capacity", "AH", "with new: capacity of the battery; the model then includes the battery", type=float)
    add("--hover-throttle", "PART", "with new: part of the largest thrust, as in MPC_THR_HOVER", type=float)
    add("--thrust-stand", "FILE", "with new: CSV with columns throttle, thrust_g, speed_rpm, current_a", type=Path)
    add("--lag", "S", "with new: measured time constant of the rotors", type=float)
    add("--inertia", "X,Y,Z", "with new: measured moments of inertia, kg m²")
    add("--drag", "N_S_M", "with new: measured horizontal drag, N per m/s", type=float)
    add("--from-log", "FILE", "with new: fit numbers to a log, .ulg (PX4, Colibri) or .bin (ArduPilot)", type=Path)
    parser.flag("--force", "with new: overwrite the file")


def check_controller(parser: ArgumentParser) -> None:
    add = parser.value
    add("name", "NAME", "control law, built-in or of another package")
    add("--profile", "NAME", "control profile name or .toml (default: the one with numbers for the law)")
    add("--vehicle", "NAME", "vehicle name or .toml (default: the profile's)")
    add("--seed", "N", "seed of all random numbers (default %(default)s)", type=natural, default=0)
    add("--duration", "S", "simulated time to fly each of the thesis's tracks", type=positive, default=30.0)
    parser.several("--only", "AREA", "area to test: interface, memory, limits, optional, time, flights or restart")
    parser.flag("--quiet", "print failed checks only")


def check_vehicle(parser: ArgumentParser) -> None:
    add = parser.value
    add("vehicle", "NAME", "vehicle name or .toml")
    add("--profile", "NAME", "control profile name or .toml", default="flight")
    add("--controller", "NAME", "control law, as for colibri fly (default: the profile's)")
    add("--seed", "N", "seed of turbulence and sensors (default %(default)s)", type=natural, default=0)
    add("--workers", "N", "number of processes (default: one per core)", type=int)
    parser.flag("--json", "print only the result, as JSON")
    _out(parser, "out/check-vehicle", "check.json and the figure")


def gym(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("action", choices=["export"], help="write POLICY.toml beside a policy")
    add("policy", "POLICY.onnx", "model from observations, (1, n), to actions, (1, a)", type=Path)
    add("--env", "NAME", "environment in which it was trained", default="colibri/Hover-v0")
    parser.several("--set", "KEY=VALUE", "keyword argument of the environment", type=keyword)


def certify(parser: ArgumentParser) -> None:
    add = parser.value
    add("profile", "PROFILE", "control profile name or .toml")
    add("--controller", "NAME", "control law with a table in the profile (default: the profile's)")
    add("--vehicle", "NAME", "vehicle name or .toml (default: the profile's)")
    add("--moment", "NM", "largest disturbance moment, N m", type=positive, default=0.01)
    add("--charge", "PART", "largest part of the battery's charge that is used", type=part, default=0.5)
    least = "smallest part of the profile's ranges with a Lyapunov function; with less the law is refused"
    add("--least", "PART", least, type=part, default=0.5)
    add("--flights", "N", "number of test flights from the border of the certified set", type=counting, default=1000)
    add("--seed", "N", "seed of the flights (default %(default)s)", type=natural, default=0)
    _out(parser, "out/certify", "certificate, table and figure")


def show(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("what", choices=("profile", "vehicle", "law"), help="law: its gains and their formulas")
    add("name", "NAME", "name of a built-in profile or vehicle; any other name lists them", nargs="?")
    add("--vehicle", "NAME", "with law: vehicle that the gains are computed for (default: the profile's)")
    add("--profile", "NAME", "with law: the profile", default="flight")
    add("--controller", "NAME", "with law: the control law (default: the profile's)")


def compile(parser: ArgumentParser) -> None:
    parser.add_argument("what", nargs="*", help="flight, thesis, sensors, path or tests (default: all)")
    parser.flag("--quiet", "print errors only")


def doctor(parser: ArgumentParser) -> None:
    parser.value(
        "--gcs",
        "URL",
        "send a vehicle's heartbeats to a ground station, and wait for an answer: "
        f"udpout:, udpin:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD (default {GCS})",
        nargs="?",
        const=GCS,
    )
    parser.value("--within", "S", "longest wait for the answer", type=positive, default=10.0)


def bench(parser: ArgumentParser) -> None:
    add = parser.value
    parser.several(
        "--only",
        "PART",
        "stages: each stage of a control step; flights: speed of flights at several rates; sensors: the "
        "estimator, and flights on sensors; simulators: the plant's answers to PX4 and ArduPilot; ground: work for "
        "ground stations; commands: whole commands, compared with their goals",
        "all",
        choices=("stages", "flights", "sensors", "simulators", "ground", "commands"),
    )
    add("--runs", "N", "number of flights of each kind (default 3)", type=int, default=3, choices=range(1, 101))
    add("--duration", "S", "simulated time of a flight, except the thesis's spiral", type=positive, default=10.0)
    against = "another checkout with its .venv, whose commands run in turn with this one's"
    add("--against", "FOLDER", against, type=Path)
    add("--out", "FILE", "write the results as JSON", type=Path)


def verify(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("--link", default="udp", choices=("udp", "memory"), help="link (default %(default)s)")
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
    parser.flag("--renew", "with --golden: write the hashes to FILE, and print the changed ones")
    parser.several("--only", "NAME", "with --golden: only this flight")
    _out(parser, "out/verify", "the logs")


def completion(parser: ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="shell; see the examples for the place of the script")


def _flight(parser: ArgumentParser, **how: Any) -> None:
    from colibri.common.spec import add_options
    from colibri.flights.spec import FlightSpec

    add_options(parser, FlightSpec, **how)


def _view(parser: ArgumentParser) -> None:
    parser.flag("--view", "show the flight in a browser; the first line printed is the page's address")


def _engine(parser: ArgumentParser) -> None:
    parser.value("--workers", "N", "number of processes (default: one per core)", type=int)
    parser.value("--dask", "ADDRESS", "fly on a Dask cluster: address of its scheduler, for example tcp://HOST:8786")


def _gate(parser: ArgumentParser, lost: LossLimit | None, *, junit: bool = False) -> None:
    """Add what continuous integration needs; `lost` is the default of `--fail-lost`."""
    parser.several(
        "--fail-above",
        "[KEY=]VALUE",
        "exit with 1 if a number of report.json exceeds VALUE: rmse_after_20s_m (m), or the one of KEY, for "
        "example ground_contact_s=0",
        type=limit,
    )
    parser.value(
        "--fail-lost",
        "N|P%",
        "exit with 1 if more flights than this number or percentage are lost or refused "
        f"(default: {'only if all are' if lost is None else '0'})".replace("%", "%%"),
        type=loss_limit,
        default=lost,
    )
    parser.flag("--json", "print only the result, as JSON")
    if junit:
        parser.value("--junit", "FILE", "write JUnit XML, one test case per flight", type=Path)


def _out(parser: ArgumentParser, folder: str, what: str) -> None:
    parser.value("--out", "DIR", f"folder for {what}", type=Path, default=Path(folder))
    parser.flag("--quiet", "print errors only")
