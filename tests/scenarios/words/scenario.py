"""A scenario as data: what the flight begins with, what is done, and what must hold; beside the number of a peer.

The numbers of peers are those of their own suites: AP is ArduPilot's autotest, PX4 its mavsdk_tests, MAVSDK its system
tests. Where none has one, it is ours.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from colibri.sitl.vehicle import Sitl

Step: TypeAlias = Callable[[Sitl], object]
"""Something that is done, or must hold; it raises where it cannot, or does not."""
FleetStep: TypeAlias = Callable[[Sequence[Sitl]], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A scenario.

    Attributes:
        name: What it shows, in words joined by hyphens.
        peer: What a peer's suite requires, and whose; or "ours".
        holds: What is required here.
        steps: What is done, in order.
        setting: What the flight begins with, as mark `sitl` has it.
        seeds: One flight for each; none: seed 0.
        calm: Why it needs ground links that lose nothing; empty where it ends as well on rough ones.
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
