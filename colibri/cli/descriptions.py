"""`colibri show` and `colibri vehicle`: files of profiles and vehicles."""

import shlex
import sys
from argparse import Namespace
from pathlib import Path

from colibri.autopilot.control.profile import load_profile, profile_text
from colibri.autopilot.control.scaling import capability_of, formulas
from colibri.common.errors import unknown
from colibri.common.files import read_text, write_bytes
from colibri.common.process.lifecycle import fail, one_line
from colibri.plant.vehicle.data_sheets import LAYOUTS, DataSheet, propeller_of, thrust_stand_of, vehicle_file
from colibri.plant.vehicle.description import VehicleError, load_vehicle, vehicle_text
from colibri.plant.vehicle.parameter_files import FILES


def show(args: Namespace) -> int:
    with one_line():
        if args.what == "law":
            _show_law(args)
        elif args.name is None:
            fail(f"show {args.what}: a name is required")
        else:
            sys.stdout.write(profile_text(args.name) if args.what == "profile" else vehicle_text(args.name))
    return 0


def _show_law(args: Namespace) -> None:
    profile = load_profile(args.profile).with_choices(args.controller or args.name, None)
    described = load_vehicle(args.vehicle or profile.simulation.vehicle)
    law, found = profile.controller, profile.of(described)
    rows = [(name, value, "") for name, value in capability_of(described)._asdict().items()]
    for key, formula in formulas(law).items():
        room, _, name = key.rpartition(".")
        table = profile.table(law)[room] if room else profile.table(law)
        value = found.value(f"controllers.{law}.{key}")
        rows.append((key, value, "given by the profile" if name in table else f"= {formula}"))
    for name, value, formula in rows:
        numbers = ", ".join(f"{each:.4g}" for each in (value if isinstance(value, (list, tuple)) else [value]))
        sys.stdout.write(f"{name:<34}{numbers:<22}{formula}".rstrip() + "\n")


def vehicle(args: Namespace) -> int:
    if args.name == "new":
        return _new(args)
    if args.new_name is not None:
        fail(f'vehicle {args.name} "{args.new_name}": one name only (or: vehicle new NAME)')
    if args.whom is None:
        fail("--for px4 or ardupilot is required (a new vehicle: vehicle new NAME)")
    of_new = ("mass", "arm", "wheelbase", "propeller", "motor", "kv", "cells", "capacity", "lag", "inertia", "drag")
    stray = next((option for option in (*of_new, "from_log") if getattr(args, option) is not None), None)
    if stray:
        fail(f"--{stray.replace('_', '-')} is an option of vehicle new NAME")
    with one_line():
        described = load_vehicle(args.name)
        made_by = f"{described.name}, by colibri vehicle {shlex.quote(args.name)} --for {args.whom}"
        text = FILES[args.whom](described, made_by)
    if args.out is None:
        sys.stdout.write(text)
    else:
        _write(args.out, text)
    return 0


def _new(args: Namespace) -> int:
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
    measured = {"thrust": args.thrust_stand, "rotor lag": args.lag, "inertia": args.inertia, "drag": args.drag}
    estimated = ", ".join(name for name, value in measured.items() if value is None)
    with one_line():
        text, notes = vehicle_file(_sheet(args, name))
        lines = [f"wrote {out}: {notes[0]}", *notes[1:], *([f"not measured: {estimated}"] if estimated else [])]
        if args.from_log is not None:
            from colibri.analysis.refinement import refined  # SciPy and Numba load slowly

            text, table = refined(text, args.from_log)
            lines = [*table, f"wrote {out}"]
    if out.exists() and not args.force:
        fail(f"{out} exists: choose another name, or --force to overwrite it")
    _write(out, text)
    sys.stdout.write("\n".join([*lines, f"next: colibri fly hover --vehicle {shlex.quote(str(out))}"]) + "\n")
    return 0


def _sheet(args: Namespace, name: str) -> DataSheet:
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
