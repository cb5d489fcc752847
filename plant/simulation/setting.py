"""What a plant flies in and how it begins, as plain values; loads nothing.

A value is that of the option of the same name of `colibri plant`: what the option reads, or the text that it reads.
"""

from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldSetting:
    """The world of a flight.

    Attributes:
        without: Parts that are left out of the plant's vehicle: "drag", "ground", "battery", "rotor-lag".
        wind: "5@270": 5 m/s from the west; or a .csv file; None for calm.
        gusts: "6@270:start=10,duration=2", each.
        turbulence: "light", "moderate", "severe"; None for none.
        start: How the vehicle begins: x, y, z (m, ENU), phi, theta, psi (degrees), vx, vy, vz (m/s), p, q, r (rad/s),
            rotors (rpm).
        latency: One way between plant and autopilot, ms: commands act so much later, twice.
    """

    without: tuple[str, ...] = ()
    wind: Any = None
    gusts: tuple[Any, ...] = ()
    turbulence: Any = None
    seed: int = 0
    start: Any = field(default_factory=dict)
    latency: float = 0.0


def world_values(of: object) -> dict[str, Any]:
    """Return what a setting, or a command line that was read, has of the world."""
    values = {each.name: getattr(of, each.name) for each in fields(WorldSetting)}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
