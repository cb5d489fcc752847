"""Events of a flight, each at a time: what happens to the plant, and what ground stations send.

As text `5:payload=0.2`; as a table `{t = 5, event = "payload", kg = 0.2}`, `[[events]]` in a TOML file.
"""

from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import msgspec

from colibri.common.config import plain, read_toml
from colibri.common.errors import shown, unknown
from colibri.common.process.arguments import number
from colibri.mavlink.client.events import EventError, Mode, Setpoint, StationEvent, TimedEvent
from colibri.mavlink.hil import faults
from colibri.mavlink.hil.faults import Equipment, Fault
from colibri.mavlink.hil.world_changes import MAX_PAYLOAD_KG, PayloadChange
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.plant.environment.weather import MAX_SPEED_M_S, RecordedWind, Wind
from colibri.plant.texts import wind as read_wind
from colibri.plant.vehicle.description import Vehicle

EVENT = "T:KIND=VALUE|FILE.toml"
_SAMPLED_S = 0.02  # interval of samples of a wind that is a function


class Payload(TimedEvent, frozen=True, tag="payload"):
    """Carry `kg` more than the vehicle's mass from `t` s on."""

    FORM = "KG"
    kg: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_PAYLOAD_KG)]

    @property
    def change(self) -> PayloadChange:
        return PayloadChange(self.kg)


class Blow(TimedEvent, frozen=True, tag="wind"):
    """Replace the mean wind from `t` s on: constant, from a file, or a function of time to m/s, ENU."""

    FORM = "SPEED@FROM|FILE.csv"
    wind: Wind | RecordedWind

    @property
    def change(self) -> Wind | RecordedWind:
        return self.wind


class Failure(TimedEvent, frozen=True, tag="failure"):
    """Fail as MAV_CMD_INJECT_FAILURE: FAILURE_UNIT, FAILURE_TYPE, instance from 1 (0: all), and its numbers."""

    FORM = "UNIT,TYPE[,INSTANCE[,VALUE...]]"
    unit: str
    type: str
    instance: Annotated[int, msgspec.Meta(ge=0)] = 0
    values: Annotated[tuple[float, ...], msgspec.Meta(max_length=4)] = ()

    def __post_init__(self) -> None:
        self.change  # noqa: B018 - refuses unknown names

    @property
    def change(self) -> Fault:
        a, b, c, d = (*self.values, 0.0, 0.0, 0.0, 0.0)[:4]
        unit, kind = _number("FAILURE_UNIT", self.unit), _number("FAILURE_TYPE", self.type)
        return Fault(unit, kind, self.instance, (a, b, c, d))


class Motor(TimedEvent, frozen=True, tag="motor"):
    """Leave a rotor, from 1 (0: all), this fraction of its thrust: 0 is lost, 1 is normal again."""

    FORM = "ROTOR,FRACTION"
    rotor: Annotated[int, msgspec.Meta(ge=0)]
    fraction: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.0

    @property
    def change(self) -> Fault:
        kind = {0.0: faults.OFF, 1.0: faults.OK}.get(self.fraction, faults.WRONG)
        return Fault(faults.MOTOR, kind, self.rotor, (self.fraction, 0.0, 0.0, 0.0))


PlantEvent: TypeAlias = Payload | Blow | Failure | Motor
Event: TypeAlias = PlantEvent | StationEvent
KINDS: dict[str, Any] = {str(it.__struct_config__.tag): it for it in (Payload, Blow, Failure, Motor, Mode, Setpoint)}
FORMS = ", ".join(f"{kind}={it.FORM}" for kind, it in KINDS.items())


class _File(msgspec.Struct, forbid_unknown_fields=True):
    events: list[dict[str, Any]]


def event(text: str) -> Any:
    """Read an event, or the events of a file."""
    try:
        if text.endswith(".toml"):
            return tuple(map(event_of, read_toml(Path(text), _File, EventError).events))
        return _of_text(text)
    except EventError as error:
        raise ArgumentTypeError(str(error)) from error


def events_of(given: Iterable[Any], duration_s: float) -> tuple[Event, ...]:
    """Return events by time; functions of the wind are sampled up to `duration_s`."""
    found: list[Any] = []
    for each in given:
        found += each if isinstance(each, list | tuple) else [each]
    return tuple(sorted((event_of(each, duration_s) for each in found), key=lambda each: each.t))


def event_of(given: Any, duration_s: float = 0.0) -> Event:
    if isinstance(given, str):
        return _of_text(given)
    if isinstance(given, TimedEvent):
        given = msgspec.structs.asdict(given) | {"event": given.kind}
    if not isinstance(given, Mapping):
        raise EventError(f'an event must be a table or a text {EVENT}, not {type(given).__name__} "{shown(given)}"')
    values = {key: plain(value) for key, value in given.items()}
    name = values.pop("event", None)
    if name is None:
        raise EventError(f'an event needs the key "event" (choose {", ".join(KINDS)}), not only {", ".join(values)}')
    if name not in KINDS:
        raise EventError(unknown("event", name, KINDS))
    if name == "wind" and "wind" in values:
        values["wind"] = _wind(values["wind"], duration_s)
    try:
        found: Event = msgspec.convert(values | {"event": name}, KINDS[name], dec_hook=lambda kind, value: kind(value))
    except msgspec.ValidationError as error:
        raise EventError(f"{name}: {str(error).replace('`', '')}") from error
    if not all(isfinite(it) for it in (found.t, *getattr(found, "values", ()))):
        raise EventError(f"{name}: t and values must be finite, not {shown(given)}")
    return found


def equipment(vehicle: Vehicle, *, on_sensors: bool) -> set[Equipment]:
    has = {Equipment.ROTORS: True, Equipment.BATTERY: vehicle.battery is not None, Equipment.SENSORS: on_sensors}
    return {part for part, there in has.items() if there}


def check_events(events: Iterable[Event], vehicle: Vehicle, *, on_sensors: bool, served: bool = False) -> None:
    """Raise an EventError for what this plant cannot do, or ground stations must send unless they are `served`."""
    parts = equipment(vehicle, on_sensors=on_sensors)
    for each in events:
        if isinstance(each, StationEvent) and not served:
            raise EventError(
                f"event {each.kind} at t = {each.t:g} s needs ground stations: fly it by colibri fly --gcs, by colibri "
                "sitl or, in pytest, with the mark sitl"
            )
        rotors = vehicle.rotors.count
        judged = faults.judged(each.change, parts, rotors) if isinstance(each, Failure | Motor) else None
        if isinstance(judged, Refusal):
            raise EventError(f"event {each.kind} at t = {each.t:g} s: {judged.reason}")


def _of_text(text: str) -> Event:
    at, colon, rest = text.partition(":")
    kind, equals, value = rest.partition("=")
    try:
        values: dict[str, Any] = {"t": number(at)}
        if not colon or not equals:
            raise ValueError
        if kind not in KINDS:
            raise EventError(unknown("event", kind, KINDS))
        words = value.split(",")
        if kind == "failure":
            values |= {"unit": words[0], "type": words[1], "values": list(map(number, words[3:]))}
            values |= {"instance": int(words[2])} if len(words) > 2 else {}
        elif kind == "motor":
            rotor, *fraction = words
            values |= {"rotor": int(rotor)} | ({"fraction": number(",".join(fraction))} if fraction else {})
        elif kind == "setpoint":
            values["position"] = [number(word) for word in words]
        else:
            mode, _, arm = value.partition(",")
            values |= {"payload": {"kg": value}, "wind": {"wind": value}, "mode": {"mode": mode}}[kind]
            if kind == "payload":
                values["kg"] = number(value)
            elif kind == "mode" and arm:
                values["arm"] = {"arm": True}[arm]
    except (ValueError, LookupError):
        raise EventError(
            f'must be T:KIND=VALUE with {FORMS}; for example "5:payload=0.2", not "{shown(text)}"'
        ) from None
    return event_of(values | {"event": kind})


def _wind(given: Any, duration_s: float) -> Any:
    if isinstance(given, str):
        try:
            return _plain_wind(read_wind(given))
        except ArgumentTypeError as error:
            raise EventError(f"wind: {error}") from None
    if callable(given):
        if not isfinite(duration_s):
            raise EventError("wind: a function needs a flight that ends: give a duration, or a file")
        times = [i * _SAMPLED_S for i in range(int(duration_s / _SAMPLED_S) + 2)]
        rows = [_air(given, t) for t in times]
        return {"path": "", "times_s": times, "velocities_enu_m_s": rows}
    return _plain_wind(given) if isinstance(given, Wind | RecordedWind) else given


def _plain_wind(given: Wind | RecordedWind) -> Any:
    if isinstance(given, Wind):
        return list(given)
    return {"path": "", "times_s": given.times_s, "velocities_enu_m_s": given.velocities_enu_m_s}


def _air(function: Any, time_s: float) -> list[float]:
    try:
        velocity = [float(axis) for axis in function(time_s)]
    except Exception as error:
        raise EventError(f"wind: the function raised {type(error).__name__} at t = {time_s:g} s: {error}") from error
    if len(velocity) != 3 or not all(abs(axis) <= MAX_SPEED_M_S for axis in velocity):
        raise EventError(f"wind: a function must return three numbers, ENU, m/s, not {shown(velocity)}")
    return velocity


def _number(enum: str, given: str) -> int:
    prefix = f"{enum}_SENSOR_" if enum == "FAILURE_UNIT" else f"{enum}_"
    known = {row.name.removeprefix(f"{enum}_").lower(): n for n, row in mav.enums[enum].items()}
    known = {name: n for name, n in known.items() if n in _OF_PLANT[enum]}
    short = {name.removeprefix("sensor_").removeprefix("system_"): n for name, n in known.items()}
    found: int | None = (known | short).get(given.lower().removeprefix(prefix.lower()))
    if found is None:
        raise EventError(unknown(enum, given, short))
    return found


_OF_PLANT = {"FAILURE_UNIT": {unit for unit, _ in faults.TABLE}, "FAILURE_TYPE": {kind for _, kind in faults.TABLE}}


def plant_events(events: Iterable[Event]) -> tuple[PlantEvent, ...]:
    return tuple(it for it in events if isinstance(it, PlantEvent))


def changes_of(events: Iterable[Event]) -> list[tuple[int, Any]]:
    """Return the changes of the plant by time, µs."""
    return [(round(it.t * 1e6), it.change) for it in plant_events(events)]
