"""`colibri show`."""

import sys
from argparse import Namespace

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail, one_line


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("what", choices=("profile", "vehicle", "law"), help="what to show")
    add("name", "NAME", "name of one that comes with Colibri; any other name lists them", nargs="?")
    add("--vehicle", "NAME", "of law: the vehicle from which its numbers follow (default: the profile's)")
    add("--profile", "NAME", "of law: the profile", default="flight")
    add("--controller", "NAME", "of law: the control law (default: the profile's)")


def run(args: Namespace) -> int:
    from colibri.autopilot.control.profile import profile_text
    from colibri.plant.vehicle.description import vehicle_text

    with one_line():
        if args.what == "law":
            _show_law(args)
        elif args.name is None:
            fail(f"show {args.what}: a name is required")
        else:
            sys.stdout.write(profile_text(args.name) if args.what == "profile" else vehicle_text(args.name))
    return 0


def _show_law(args: Namespace) -> None:
    from colibri.autopilot.control.profile import load_profile
    from colibri.autopilot.control.scaling import capability_of, formulas
    from colibri.plant.vehicle.description import load_vehicle

    profile = load_profile(args.profile).with_choices(args.controller or args.name, None)
    vehicle = load_vehicle(args.vehicle or profile.simulation.vehicle)
    law, found = profile.controller, profile.of(vehicle)
    rows = [(name, value, "") for name, value in capability_of(vehicle)._asdict().items()]
    for key, formula in formulas(law).items():
        room, _, name = key.rpartition(".")
        table = profile.table(law)[room] if room else profile.table(law)
        value = found.value(f"controllers.{law}.{key}")
        rows.append((key, value, "given by the profile" if name in table else f"= {formula}"))
    for name, value, formula in rows:
        numbers = ", ".join(f"{each:.4g}" for each in (value if isinstance(value, (list, tuple)) else [value]))
        sys.stdout.write(f"{name:<34}{numbers:<22}{formula}".rstrip() + "\n")
