"""`python -m tools.pages.faults FOLDER`: writes `faults.md`, what can be injected, from the vocabulary's own table."""

import sys
from collections.abc import Iterator
from pathlib import Path

from colibri.mavlink.hil.faults import ROWS, Part, Row, Value, kind_name, unit_name

_HEAD = """# Faults

What can go wrong in the plant on command, by MAV_CMD_INJECT_FAILURE (420). It is refused (DENIED) until parameter
`SYS_FAILURE_EN` is 1. ACCEPTED comes when it has happened: the autopilot hands it on with its answer to the next
frame, the plant does it at that instant of simulated time, and the frame after that brings its word. What this
vehicle has not, or what would change nothing, is UNSUPPORTED: sensors of a vehicle that is flown by its state
(`--feedback state`), a battery that the vehicle file has not, another simulator at the other end. Impossible numbers
are DENIED. A STATUSTEXT says why.

Rotors count as in the vehicle file, from 1 on; of everything else there is one. Instance 0 is all. Numbers are param4
to param7, in the order of the table; 0 or nan is not given, and what is then taken is in brackets. One fault at a
time: another of the same part takes its place, OK ends it. Noise is by `--seed`, and no other chance changes: up to
the fault, a flight is the same bit for bit as without. Written by `python -m tools.pages.faults docs`; a test holds
that it agrees with the table in `mavlink/hil/faults.py`.

```sh
param set SYS_FAILURE_EN 1                        # MAVProxy
long MAV_CMD_INJECT_FAILURE 101 4 1 0.65          # rotor 1 is left 65 % of its thrust
long MAV_CMD_INJECT_FAILURE 101 0 0               # all rotors are well again
```

MAVSDK: `Failure(vehicle).inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)`, on `colibri sitl --feedback sensors`.

"""

_TAIL = """
## Links and processes

- A slow control law: parameter `SIM_SOLVE_MS` declares how long it takes. What it decides takes effect so much
  simulated time after its sample, the command before is held, and samples due meanwhile are skipped. Nothing is
  measured: the flight is the same on any computer. `0` is none; where it is longer than the control interval, the
  deadline is missed.
- A slow link: `--latency MS` of `colibri fly`, `sitl` and `plant`, see [latency.md](latency.md).
- A plant that waits for nobody: `colibri plant --realtime`, see [realtime.md](realtime.md).
- The battery is the plant's: it tells the autopilot twice a second, and at once one that has just started. Charges
  that differ by less than 2 % of the capacity from the autopilot's own count are left to that.
"""
_PARTS = {
    Part.SENSORS: "Sensors",
    Part.BATTERY: "Battery",
    Part.ROTORS: "Rotors",
}


def page() -> str:
    """Return the page."""
    lines = []
    for part, title in _PARTS.items():
        lines += [f"## {title}", "", "| unit | type | what it does | numbers |", "|---|---|---|---|"]
        lines += [*_rows(part), ""]
    return _HEAD + "\n".join(lines).rstrip() + "\n" + _TAIL


def _rows(part: Part) -> Iterator[str]:
    for row in ROWS:
        if row.part is part:
            unit, kind = f"{unit_name(row.unit)} {row.unit}", f"{kind_name(row.kind)} {row.kind}"
            yield f"| {unit} | {kind} | {row.meaning} | {_numbers(row)} |"


def _numbers(row: Row) -> str:
    """Return what the numbers are; the axes of a vector, which are alike, in one."""
    if len(row.values) == len("xyz"):
        name = row.values[0].name.removesuffix(" x")
        return _number(row.values[0], f"{name} x, y, z", ", ".join(f"{value.usual:g}" for value in row.values))
    return "; ".join(_number(value, value.name, f"{value.usual:g}") for value in row.values)


def _number(value: Value, name: str, usual: str) -> str:
    unit = "" if value.unit == "1" else f" {value.unit}"
    return f"{name}: {value.minimum:g} to {value.maximum:g}{unit} ({usual})"


def main() -> int:
    """Write the page into the folder that the command line names."""
    (Path(sys.argv[1]) / "faults.md").write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
