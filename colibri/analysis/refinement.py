"""A vehicle file with numbers fitted to a log."""

import re
import tomllib
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from colibri.analysis.export import log_file
from colibri.analysis.identification import Identified, Number, identify
from colibri.analysis.recorded_motion import LogError, read_motion
from colibri.common.config import SettingsError, read_settings
from colibri.plant.vehicle.description import Vehicle


def refined(text: str, log: Path) -> tuple[str, list[str]]:
    """Return a vehicle file, with each key on its own line, with numbers fitted to a flight's log; and a table of them.

    Raises:
        Error: The log is unreadable, has too little flight, or is one of another vehicle.
    """
    log = log_file(log)
    first = read_settings(tomllib.loads(text), Vehicle)
    try:
        found = identify(read_motion(log), first)
        for key, group in groupby(found.numbers, lambda number: re.sub(r"\.\d$", "", number.key)):
            numbers = list(group)
            if any(number.is_fitted for number in numbers):
                values = ", ".join(f"{each.after if each.is_fitted else each.before:.5g}" for each in numbers)
                widths = ", ".join(_width(each) if each.is_fitted else "kept" for each in numbers)
                value = values if len(numbers) == 1 else f"[{values}]"
                text = _with_value(text, key, value, f"fitted to {log.name}: {widths}")
        control = first.rotors.control if found.curve is None else ("speed" if found.curve > 0.5 else "thrust")
        if control != first.rotors.control:
            text = _with_value(text, "rotors.control", f'"{control}"', f"fitted to {log.name}")
        return text, list(_lines(found, read_settings(tomllib.loads(text), Vehicle), log))
    except (LogError, SettingsError, ValueError) as error:  # NumPy and SciPy refuse numbers of a damaged log
        raise LogError(f"{log}: {error}") from error


def _with_value(text: str, key: str, value: str, source: str) -> str:
    """Return a vehicle file with another value, in TOML, at a dotted key of a table, and its source as comment."""
    table, _, name = key.rpartition(".")
    lines = text.splitlines()
    begin = 1 + next(place for place, line in enumerate(lines) if line.startswith(f"[{table}]"))
    end = next((place for place in range(begin, len(lines)) if lines[place].startswith("[")), len(lines))
    old = next((place for place in range(begin, end) if lines[place].startswith(f"{name} =")), None)
    lines[begin if old is None else old : begin if old is None else old + 1] = [f"{name} = {value}  # {source}"]
    return "\n".join(lines) + "\n"


def _width(number: Number) -> str:
    return "not in the log" if number.relative > 9.99 else f"± {100.0 * number.relative:.2g} %"


def _lines(found: Identified, vehicle: Vehicle, log: Path) -> Iterator[str]:
    yield f"fitted to {log}: {found.flight_s:.1f} s of flight, of which the last quarter is held out"
    yield f"{'number':<36}{'before':>11}{'after':>11}  95 %"
    for number in found.numbers:
        after, kept = (number.after, "") if number.is_fitted else (number.before, "kept: ")
        yield f"{number.key:<36}{number.before:>11.4g}{after:>11.4g}  {kept}{_width(number)}"
    yield f"{'on the held-out part':<36}{'measured':>11}{'error':>11}  RMS"
    for quantity, unit, size, error in found.held_out:
        yield f"{quantity:<36}{size:>11.3g}{error:>11.3g}  {unit}"
    weight_n, thrust_n = vehicle.body.mass_kg * vehicle.gravity_m_s2, vehicle.max_wrench()[0]
    hover = vehicle.hover_speed / vehicle.rotors.max_speed
    yield f"thrust {thrust_n:.3g} N, {thrust_n / weight_n:.2f} times the weight; hover at {hover:.2f} of the top speed"
    if found.curve is not None:
        delay_ms = round(1e3 * found.delay_s)
        yield f"thrust curve (THR_MDL_FAC) {found.curve:.2f}; delay from command to rotor {delay_ms} ms"
