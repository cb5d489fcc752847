"""Checks of a law's members, and of its decisions after extreme states and references that jump."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.control.interface import Controller, Decision, Preview
from colibri.autopilot.control.registry import BuildError, DecisionError, check_rotor_speeds, in_words
from colibri.common.errors import Error
from colibri.common.types import Array
from colibri.conformance.step_records import FlownStep, fly_for_steps, jumped
from colibri.conformance.subject import Result, Row, Subject, judged, not_applicable


class Protocol(NamedTuple):
    """A part of the interface, used if all its members exist."""

    what: str
    members: tuple[str, ...]


ATTITUDE = Protocol("an attitude and a thrust instead of a position", ("step_attitude",))
CHARGE = Protocol("charge taken from the battery", ("charge_ah", "with_charge"))
MASS = Protocol("mass estimated in flight", ("mass_kg", "with_mass"))
PATH = Protocol("speed along the references", ("min_path_speed", "step_on_path", "path_speed", "lag_us", "with_lag"))
PLAN = Protocol("plan of attitudes", ("plan_columns",))
COMPILED = Protocol("compiled parts", ("warm_up",))
OPTIONAL = (ATTITUDE, CHARGE, MASS, PATH, PLAN, COMPILED)  # in the order of docs/controllers.md


def interface_checks(subject: Subject) -> Iterator[Row]:
    law = subject.build()
    built = f"law = built({subject.of_law})"
    see = subject.script(f"{built}; print(law.preview)", "built")
    rhythm = f"{law.control_interval_us / 1000:g} ms; {law.preview[1]} references"
    yield judged("control_interval_us, preview", _rhythm_wrong(law), rhythm, see)
    speed, failure = _initial_wrong(subject, law)
    see = subject.script(f"{built}; law.initial({speed!r})", "built")
    yield judged("initial at any rotor speed", failure, f"{len(_speeds(subject))} speeds", see)
    see = subject.script(f"{built}; print(dir(law))", "built")
    found = ", ".join(protocol.members[0] for protocol in OPTIONAL if has(law, protocol)) or "none"
    yield judged("optional members in whole groups", _halves(law), found, see)
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
        return Row("", tried, Result.FIGURE, f"no: {error}")
    except Error:
        return Row("", tried, Result.OK, "refused")
    return Row("", tried, Result.FIGURE, "no: read_settings reads it strictly")


_S, _SAMPLES = 0.4, 6  # duration of each flight, and least number of samples
_STARTS = 5
Draw: TypeAlias = Callable[[np.random.Generator], dict[str, float]]


class FlightKind(NamedTuple):
    tried: str
    track: str
    draw: Draw
    needs_ground: bool = False


def _direction(rng: np.random.Generator, length: float) -> Array:
    direction = rng.normal(size=3)
    return length * direction / np.linalg.norm(direction)


def _fast(rng: np.random.Generator) -> dict[str, float]:
    vx, vy, vz = _direction(rng, rng.uniform(3.0, 12.0))
    return {"z": 40.0, "vx": vx, "vy": vy, "vz": vz}


def _upside_down(rng: np.random.Generator) -> dict[str, float]:
    return {"z": 40.0, "phi": rng.uniform(150.0, 210.0), "theta": rng.uniform(-30.0, 30.0)}


def _tumbling(rng: np.random.Generator) -> dict[str, float]:
    (p, q, r), (phi, theta, psi) = _direction(rng, 10.0), rng.uniform(-180.0, 180.0, 3)
    return {"z": 60.0, "phi": phi, "theta": theta / 2.0, "psi": psi, "p": p, "q": q, "r": r}


def _far_away(rng: np.random.Generator) -> dict[str, float]:
    x, y, _ = _direction(rng, rng.uniform(10.0, 60.0))
    return {"x": x, "y": y, "z": rng.uniform(20.0, 60.0), "psi": rng.uniform(-180.0, 180.0)}


def _near_the_ground(rng: np.random.Generator) -> dict[str, float]:
    return {"z": rng.uniform(0.1, 0.4), "vz": rng.uniform(-2.0, 0.0), "phi": rng.uniform(-10.0, 10.0)}


def _on_the_ground(rng: np.random.Generator) -> dict[str, float]:
    return {"x": rng.uniform(-3.0, 3.0), "z": 0.0, "psi": rng.uniform(-180.0, 180.0), "rotors": 0.0}


def _gentle(rng: np.random.Generator) -> dict[str, float]:
    vx, vy, vz = _direction(rng, 1.0)
    return {"z": 3.0, "phi": rng.uniform(-25.0, 25.0), "theta": rng.uniform(-25.0, 25.0), "vx": vx, "vy": vy, "vz": vz}


KINDS = (
    FlightKind("from about hover", "hover:height=3", _gentle),
    FlightKind("fast, in any direction", "lemniscate:height=40", _fast),
    FlightKind("upside down", "hover:height=40", _upside_down),
    FlightKind("tumbling", "hover:height=60", _tumbling),
    FlightKind("far from the reference", "circle:height=30,speed=4", _far_away),
    FlightKind("near the ground, sinking", "hover:height=0.2", _near_the_ground, needs_ground=True),
    FlightKind("standing on the ground", "hover:height=2", _on_the_ground, needs_ground=True),
)


def limit_checks(subject: Subject) -> Iterator[Row]:
    seconds = max(_S, _SAMPLES * subject.build().control_interval_us * 1e-6)
    calm: list[tuple[dict[str, Any], list[FlownStep]]] = []
    for number, kind in enumerate(KINDS):
        if kind.needs_ground and subject.vehicle.ground is None:
            yield not_applicable(kind.tried, f"{subject.vehicle.name} has no ground")
            continue
        rng = np.random.default_rng((subject.seed, number))
        count, failure, see = 0, "", ""
        for _ in range(_STARTS):
            drawn = {key: round(float(value), 3) for key, value in kind.draw(rng).items()}
            options = {"start": subject.start(**drawn), "duration": seconds}
            failure, steps = _failure(subject, kind.track, options)
            count += len(steps)
            if failure:
                see = subject.command(kind.track, **options)
                break
            if number == 0:
                calm.append((options, steps))
        yield judged(kind.tried, failure, f"{count} steps of {_STARTS} flights", see)
    yield _jumps(subject, calm)


def out_of_limits(subject: Subject, decision: Decision) -> str:
    """Describe an invalid part of a decision."""
    speeds, rotors = decision.rotor_speeds, subject.vehicle.rotors
    if (
        not isinstance(speeds, np.ndarray)
        or speeds.shape != (rotors.count,)
        or not np.issubdtype(speeds.dtype, np.floating)
    ):
        return f"rotor_speeds is not an array of {rotors.count} floats: {speeds!r}"
    try:
        check_rotor_speeds(subject.name, speeds, rotors)
        angles, plan = np.array(decision.attitude_reference, dtype=float), decision.diagnostics.predicted
        if plan is not None and not np.isfinite(plan).all():
            return "diagnostics.predicted is not finite"
    except (DecisionError, AttributeError, TypeError, ValueError) as error:
        return in_words(error)
    if angles.shape != (3,) or not np.isfinite(angles).all():
        return f"attitude_reference is not three finite angles: {decision.attitude_reference!r}"
    return ""


def _failure(subject: Subject, track: str, options: dict[str, Any]) -> tuple[str, list[FlownStep]]:
    try:
        flown = fly_for_steps(subject, track, **options)
    except Error as error:
        return str(error), []
    wrong = (out_of_limits(subject, step.decision) for step in flown.steps)
    return flown.failure or next(filter(None, wrong), ""), flown.steps


def _jumps(subject: Subject, flights: list[tuple[dict[str, Any], list[FlownStep]]]) -> Row:
    tried, law, count = "references that jump, airborne or not", subject.build(), 0
    for options, steps in flights:
        for index, step in enumerate(steps):
            seed = subject.seed + index
            try:
                failure = out_of_limits(subject, jumped(step, seed).again(law, step.memory)[1])
            except Exception as error:
                failure = in_words(error)
            count += 1
            if failure:
                code = f"x = s[{index}]; print(jumped(x, {seed}).again(law, x.memory)[1])"
                return judged(tried, failure, "", subject.snippet(code, KINDS[0].track, **options))
    return judged(tried, "", f"{count} steps", "") if count else not_applicable(tried, "it took no step")
