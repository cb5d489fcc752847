"""The uploaded geofence and the fence around home."""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from colibri.autopilot.commander.home import Home
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.geofence import EDGE_M, OUTSIDE, AroundHome, Geofence
from colibri.common.types import Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.wire.refusal import Refusal

CHECKED_AT_ONCE = 30_000
"""Pairs of a place and an edge of the fence; more of them do not fit into the processor's cache."""
_LOOK_EVERY_US = 100_000
_ITEM_US, _PAIR_US = 4.0, 0.02
"""Work to build an item of a fence, and to compare a place with one of its edges."""


class Fence:
    """The fences of one vehicle."""

    def __init__(self, home: Home, behaviour: Behaviour, budget: Budget) -> None:
        self._home, self.budget = home, budget
        self._behaviour = behaviour
        self._items: tuple[MissionItem, ...] = ()
        self._geofence = Geofence((), home.origin)
        self._breach: Refusal | None = None
        self.against_arming: Refusal | None = None
        self._breach_due_us, self._arming_margin_m = 0, 0.0

    def adopt(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour

    def load(self, items: Sequence[MissionItem]) -> None:
        self._items = tuple(items)
        self.rebuild()

    def rebuild(self) -> None:
        self.budget.spend(_ITEM_US * len(self._items))
        self._geofence = Geofence(self._items, self._home.origin)
        self._breach, self._breach_due_us = None, 0

    @property
    def loaded(self) -> bool:
        return bool(self._items)

    @property
    def exists(self) -> bool:
        behaviour = self._behaviour
        return self.loaded or behaviour.max_distance_m > 0.0 or behaviour.max_height_m > 0.0

    @property
    def _around_home(self) -> AroundHome:
        behaviour = self._behaviour
        return AroundHome(self._home.position_enu_m, behaviour.max_distance_m, behaviour.max_height_m)

    def refusal(self, place: Vector) -> Refusal | None:
        return self._geofence.refusal(place) or self._around_home.refusal(place)

    @property
    def size(self) -> int:
        """Edges and circles that each place is compared with."""
        return self._geofence.size + 1

    def first_outside(self, places: Sequence[Vector]) -> tuple[int, Refusal] | None:
        """Return the index of the first place outside, and why it is; many of them are compared at once."""
        if not self.exists:
            return None
        self.budget.spend(_PAIR_US * len(places) * self.size)
        at_once, around = max(CHECKED_AT_ONCE // self.size, 1), self._around_home
        parts = np.split(np.array(places)[:, :2], range(at_once, len(places), at_once))
        margins = chain.from_iterable(self._geofence.margins_m(part).tolist() for part in parts)
        for i, (place, margin) in enumerate(zip(places, margins, strict=True)):
            refusal = around.refusal(place) if margin >= -EDGE_M else OUTSIDE
            if refusal is not None:
                return i, refusal
        return None

    def margin_m(self, place: Vector) -> float:
        """Return the distance to the nearest edge, m; negative outside."""
        return min(self._geofence.margin_m(place), self._around_home.margin_m(place))

    def breach(self, place: Vector, now_us: int, margin_m: float) -> Refusal | None:
        """Check the current position, at 10 Hz because polygons are slow; within the margin arming is refused, too."""
        if not self.exists:
            self._breach = self.against_arming = None
        elif now_us >= self._breach_due_us:
            self._breach_due_us, self._arming_margin_m = now_us + _LOOK_EVERY_US, margin_m
            self._breach = self.refusal(place)
            self.against_arming = self._breach or self.arming_refusal(place)
        return self._breach

    def arming_refusal(self, place: Vector) -> Refusal | None:
        """Check a position by the fence of this moment, also in the frame in which it is loaded."""
        refusal, margin_m = self.refusal(place), self._arming_margin_m
        if refusal is None and margin_m > 0.0 and self.margin_m(place) < margin_m:
            return Refusal(f"within {margin_m:g} m (GF_MARGIN) of the geofence's edge")
        return refusal
