"""Checks of a law's members: interval, references, and optional protocols, each complete."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from colibri.autopilot.control.interface import Controller, Preview
from colibri.autopilot.control.registry import BuildError, in_words
from colibri.common.errors import Error
from colibri.conformance.subject import Result, Row, Subject, judged

AREA = "interface"


class Protocol(NamedTuple):
    """An optional part of the interface, used only if all its members exist."""

    what: str
    members: tuple[str, ...]


ATTITUDE = Protocol("an attitude and a thrust instead of a position", ("step_attitude",))
CHARGE = Protocol("charge taken from the battery", ("charge_ah", "with_charge"))
MASS = Protocol("mass estimated in flight", ("mass_kg", "with_mass"))
PATH = Protocol("speed along the references", ("min_path_speed", "step_on_path", "path_speed", "lag_us", "with_lag"))
PLAN = Protocol("plan of attitudes", ("plan_columns",))
COMPILED = Protocol("compiled parts", ("warm_up",))
OPTIONAL = (ATTITUDE, CHARGE, MASS, PATH, PLAN, COMPILED)
"""In the order of docs/controllers.md."""


def interface_checks(subject: Subject) -> Iterator[Row]:
    law = subject.build()
    built = f"law = built({subject.of_law})"
    see = subject.script(f"{built}; print(law.preview)", "built")
    rhythm = f"{law.control_interval_us / 1000:g} ms; {law.preview[1]} references"
    yield judged(AREA, "control_interval_us, preview", _rhythm_wrong(law), rhythm, see)
    speed, failure = _initial_wrong(subject, law)
    see = subject.script(f"{built}; law.initial({speed!r})", "built")
    yield judged(AREA, "initial at any rotor speed", failure, f"{len(_speeds(subject))} speeds", see)
    see = subject.script(f"{built}; print(dir(law))", "built")
    found = ", ".join(protocol.members[0] for protocol in OPTIONAL if has(law, protocol)) or "none"
    yield judged(AREA, "optional members in whole groups", _halves(law), found, see)
    yield _settings(subject)


def has(law: Controller[Any], protocol: Protocol) -> bool:
    return all(hasattr(law, member) for member in protocol.members)


def _rhythm_wrong(law: Controller[Any]) -> str:
    preview = law.preview
    if not isinstance(preview, Preview):
        return f"preview is {type(preview).__name__}, not Preview(interval_us, samples)"
    interval_us, samples = preview
    if not (isinstance(interval_us, int) and isinstance(samples, int) and interval_us > 0 and samples > 0):
        return f"preview is {preview}: expected two whole numbers from 1 on"
    return ""


def _speeds(subject: Subject) -> list[float]:
    rotors = subject.vehicle.rotors
    return [0.0, rotors.idle_speed, subject.vehicle.hover_speed, 0.9 * rotors.max_speed, rotors.max_speed]


def _initial_wrong(subject: Subject, law: Controller[Any]) -> tuple[float, str]:
    for speed in _speeds(subject):
        try:
            law.initial(speed)
        except Exception as error:
            return speed, f"initial({speed:g}) raised {in_words(error)}"
    return 0.0, ""


def _halves(law: Controller[Any]) -> str:
    said = []
    for protocol in OPTIONAL:
        there = [member for member in protocol.members if hasattr(law, member)]
        if there and len(there) < len(protocol.members):
            missing = [member for member in protocol.members if member not in there]
            said.append(f"{', '.join(there)} without {', '.join(missing)}")
    return "; ".join(said)


def _settings(subject: Subject) -> Row:
    tried = "an unknown key in its table is refused"
    name = subject.name
    spoilt = {**subject.profile.table(name), "no_such_key": 1.0}
    try:
        subject.build(subject.profile.replace(f"controllers.{name}", spoilt))
    except BuildError as error:
        return Row(AREA, tried, Result.FIGURE, f"no: {error}")
    except Error:
        return Row(AREA, tried, Result.OK, "refused")
    return Row(AREA, tried, Result.FIGURE, "no: read_settings reads it strictly")
