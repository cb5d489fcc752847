"""`colibri vehicle`."""

import shlex
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from colibri.common.errors import unknown
from colibri.common.files import read_text, write_bytes
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail, one_line


def add_options(parser: ArgumentParser) -> None:
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


def run(args: Namespace) -> int:
    if args.name == "new":
        return _new(args)
    if args.new_name is not None:
        fail(f'vehicle {args.name} "{args.new_name}": one name only (or: vehicle new NAME)')
    if args.whom is None:
        fail("--for px4 or ardupilot is required (a new vehicle: vehicle new NAME)")
    of_new = ("mass", "arm", "wheelbase", "propeller", "motor", "kv", "cells", "capacity", "lag", "inertia", "drag")
    stray = next((option for option in of_new if getattr(args, option) is not None), None)
    if stray:
        fail(f"--{stray} is an option of vehicle new NAME")
    from colibri.plant.vehicle.description import load_vehicle
    from colibri.plant.vehicle.parameter_files import FILES

    with one_line():
        vehicle = load_vehicle(args.name)
        made_by = f"{vehicle.name}, by colibri vehicle {shlex.quote(args.name)} --for {args.whom}"
        text = FILES[args.whom](vehicle, made_by)
    if args.out is None:
        sys.stdout.write(text)
    else:
        _write(args.out, text)
    return 0


def _new(args: Namespace) -> int:
    from colibri.plant.vehicle.data_sheets import vehicle_file

    if args.new_name is None:
        fail("vehicle new: a name is required")
    if args.whom is not None:
        fail("--for: write the vehicle first, then: vehicle FILE.toml --for px4 or ardupilot")
    name = args.new_name.removesuffix(".toml")
    out = args.out or Path(f"{name}.toml")
    if not name or (args.out is None and Path(name).name != name):
        fail(f'vehicle new "{args.new_name}": must be a name without folders (a path goes to --out)')
    if out.suffix != ".toml":
        fail(f'--out "{out}": must end in .toml')
    with one_line():
        text, notes = vehicle_file(_sheet(args, name))
    if out.exists() and not args.force:
        fail(f"{out} exists: choose another name, or --force to overwrite it")
    _write(out, text)
    path = shlex.quote(str(out))
    measured = {"thrust": args.thrust_stand, "rotor lag": args.lag, "inertia": args.inertia, "drag": args.drag}
    estimated = ", ".join(name for name, value in measured.items() if value is None)
    lines = [f"wrote {out}: {notes[0]}", *notes[1:], *([f"not measured: {estimated}"] if estimated else [])]
    sys.stdout.write("\n".join([*lines, f"next: colibri fly hover --vehicle {path}"]) + "\n")
    return 0


def _sheet(args: Namespace, name: str) -> Any:
    from colibri.plant.vehicle.data_sheets import LAYOUTS, DataSheet, propeller_of, thrust_stand_of
    from colibri.plant.vehicle.description import VehicleError

    if args.arm is not None and args.wheelbase is not None:
        raise VehicleError("--arm and --wheelbase: give one of them")
    if args.layout not in LAYOUTS:
        raise VehicleError(unknown("--layout", args.layout, LAYOUTS))
    arm_m = args.arm if args.wheelbase is None else 0.5 * args.wheelbase
    required = {"--mass KG": args.mass, "--arm M or --wheelbase M": arm_m, "--propeller SIZE": args.propeller}
    missing = [option for option, value in required.items() if value is None]
    if missing:
        raise VehicleError(f"required: {', '.join(missing)}")
    inertia = None
    if args.inertia is not None:
        try:
            x, y, z = map(float, args.inertia.split(","))
        except ValueError:
            raise VehicleError(f'--inertia "{args.inertia}": must be three numbers, X,Y,Z in kg m²') from None
        inertia = (x, y, z)
    stand = None
    if args.thrust_stand is not None:
        try:
            stand = thrust_stand_of(read_text(args.thrust_stand))
        except (OSError, UnicodeDecodeError) as error:
            raise VehicleError(f"{args.thrust_stand}: {getattr(error, 'strerror', None) or 'is not UTF-8'}") from error
        except VehicleError as error:
            raise VehicleError(f"{args.thrust_stand}: {error}") from error
    return DataSheet(
        name=name,
        mass_kg=args.mass,
        arm_m=arm_m,
        propeller=propeller_of(args.propeller),
        layout=args.layout,
        order=args.order,
        motor=args.motor,
        kv_rpm_v=args.kv,
        cells=args.cells,
        hover_throttle=args.hover_throttle,
        capacity_ah=args.capacity,
        lag_s=args.lag,
        inertia_kg_m2=inertia,
        drag_n_s_m=args.drag,
        stand=stand,
    )


def _write(out: Path, text: str) -> None:
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(out, text.encode())
    except OSError as error:
        fail(f"cannot write {out}: {error.strerror}")
