"""Scenarios as data: initial conditions, steps and requirements, beside the requirement of a reference suite.

AP is ArduPilot's autotest, PX4 its mavsdk_tests, MAVSDK its system tests, "ours" our own requirement.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from colibri.sitl.vehicle import Sitl

Step: TypeAlias = Callable[[Sitl], object]
"""An action or a check; raises on failure."""
FleetStep: TypeAlias = Callable[[Sequence[Sitl]], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A scenario for one vehicle.

    Attributes:
        name: Words joined by hyphens.
        peer: Requirement of a reference suite, or "ours".
        holds: Requirement here.
        steps: Actions and checks, in order.
        setting: Initial conditions: arguments of mark `sitl`.
        seeds: One flight for each seed.
        calm: Reason to exclude it from rough ground links, if any.
    """

    name: str
    peer: str
    holds: str
    steps: Sequence[Step]
    setting: Mapping[str, Any] = field(default_factory=dict)
    seeds: Sequence[int] = (0,)
    calm: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetScenario:
    name: str
    peer: str
    holds: str
    count: int
    fly: FleetStep
    setting: Mapping[str, Any] = field(default_factory=dict)
