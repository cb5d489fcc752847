"""Options without effect on a flight, and what they need to have one."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from colibri.common.spec import fields_of
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.events import Blow
from colibri.plant.vehicle.description import Vehicle


class NoEffectWarning(UserWarning):
    """An option has no effect on the flight."""


class FlownOptions(NamedTuple):
    """Options, and the vehicles of autopilot and plant."""

    spec: Any
    name: str  # name or file of the plant's vehicle
    vehicle: Vehicle
    plant_vehicle: Vehicle
    whole: Vehicle | None  # the plant's vehicle with the parts that `without` leaves out, if known

    @property
    def has_drag(self) -> bool:
        drag = self.plant_vehicle.drag
        coefficients = (*drag.linear_n_s_m, *drag.quadratic_n_s2_m2, drag.rotor_coefficient) if drag else ()
        return any(coefficients)

    @property
    def is_random(self) -> bool:
        turbulent = self.spec.turbulence is not None and self.has_drag
        return self.spec.feedback is Feedback.SENSORS or turbulent or any(self.spec.noise.values())

    @property
    def starts_otherwise(self) -> bool:
        """Whether the start is more than rotor speeds that commands replace at once."""
        at_once = self.plant_vehicle.rotors.lag is None and self.spec.latency <= 0.0
        return set(self.spec.start) != {"rotors"} or not at_once

    @property
    def has_parts(self) -> bool:
        return self.whole is None or all(self.whole.without([part]) != self.whole for part in self.spec.without)


_NO_DRAG = "vehicle {vehicle} has no drag"
_NO_STATIONS = "no ground station is served"
RULES: tuple[tuple[str, str, Callable[[FlownOptions], bool]], ...] = (
    ("wind", _NO_DRAG, lambda it: it.has_drag),
    ("gusts", _NO_DRAG, lambda it: it.has_drag),
    ("gusts", "each begins after the flight", lambda it: any(g.start_s < it.spec.duration for g in it.spec.gusts)),
    ("events", "each is after the flight", lambda it: any(event.t < it.spec.duration for event in it.spec.events)),
    ("events", _NO_DRAG, lambda it: it.has_drag or not all(isinstance(event, Blow) for event in it.spec.events)),
    ("turbulence", _NO_DRAG, lambda it: it.has_drag),
    ("seed", "only sensors, turbulence on drag, and noise are random", lambda it: it.is_random),
    ("noise", "each is 0", lambda it: any(it.spec.noise.values())),
    ("without", "vehicle {vehicle} has no such part", lambda it: it.has_parts),
    ("start", "rotors of vehicle {vehicle} follow commands at once", lambda it: it.starts_otherwise),
    ("plant_vehicle", "it is the vehicle of the autopilot", lambda it: it.whole != it.vehicle),
    ("tlog", "link direct sends no frames", lambda it: it.spec.link != "direct"),
    ("signing_key", _NO_STATIONS, lambda it: bool(it.spec.gcs) or not hasattr(it.spec, "link")),
    ("insecure", _NO_STATIONS, lambda it: bool(it.spec.gcs) or not hasattr(it.spec, "link")),
    ("spacing", "one vehicle flies", lambda it: it.spec.count > 1),
)
"""Option, the reason why it has no effect, and the condition under which it has one."""


def without_effect(setting: FlownOptions) -> dict[str, str]:
    """Return the reason of each option without effect."""
    known = fields_of(type(setting.spec))
    given = {name for name, field in known.items() if getattr(setting.spec, name) != field.default}
    lacking = (rule for rule in RULES if rule[0] in given and not rule[2](setting))
    return {option: reason.format(vehicle=setting.name) for option, reason, _ in lacking}


def in_words(reasons: Iterable[tuple[str, str]], title: str = "no effect") -> str:
    """Return one line for options with reasons, empty without any."""
    by_reason: dict[str, list[str]] = {}
    for option, reason in reasons:
        by_reason.setdefault(reason, []).append(option)
    words = (f"{' and '.join(options)} ({reason})" for reason, options in by_reason.items())
    return f"{title}: {'; '.join(words)}" if by_reason else ""
