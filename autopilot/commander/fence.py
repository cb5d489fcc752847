"""The uploaded geofence and the fence around home."""

from collections.abc import Sequence
from itertools import chain
from math import inf

import numpy as np

from colibri.autopilot.commander.home import Home
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.geofence import EDGE_M, OUTSIDE, AroundHome, Geofence
from colibri.common.types import Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.wire.dialect import Refusal, mav

CHECKED_AT_ONCE = 30_000  # pairs of a place and an edge that fit into the processor's cache
_LOOK_EVERY_US = 100_000
_ITEM_US, _PAIR_US = 4.0, 0.02  # work to build an item, and to compare a place with an edge


class Fence:
    def __init__(self, home: Home, behaviour: Behaviour, budget: Budget) -> None:
        self._home, self.budget = home, budget
        self._behaviour = behaviour
        self._items: tuple[MissionItem, ...] = ()
        self._geofence = Geofence((), home.origin)
        self._breach: Refusal | None = None
        self.against_arming: Refusal | None = None
        self.breaches = self.breach_type = self.breached_us = 0  # how many, FENCE_BREACH and time of the last one
        self._breach_due_us, self._arming_margin_m = 0, 0.0
        self.above_floor = False  # the floor holds once it has been climbed over, and not for landings

    def adopt(self, behaviour: Behaviour) -> None:
        changes = behaviour.uploaded_fence is not self._behaviour.uploaded_fence
        self._behaviour = behaviour
        if changes:
            self.rebuild()

    def load(self, items: Sequence[MissionItem]) -> None:
        self._items = tuple(items)
        self.rebuild()

    def rebuild(self) -> None:
        self.budget.spend(_ITEM_US * len(self._items))
        self._geofence = Geofence(self._items if self.loaded else (), self._home.origin)
        self._breach, self._breach_due_us = None, 0

    @property
    def loaded(self) -> bool:
        return bool(self._items) and self._behaviour.uploaded_fence

    @property
    def exists(self) -> bool:
        behaviour = self._behaviour
        bounded = behaviour.max_distance_m > 0.0 or behaviour.max_height_m > 0.0
        return self.loaded or bounded or behaviour.floor_m > -inf

    @property
    def _around_home(self) -> AroundHome:
        behaviour = self._behaviour
        return AroundHome(self._home.position_enu_m, behaviour.max_distance_m, behaviour.max_height_m, self.floor_m)

    @property
    def floor_m(self) -> float:
        """Return the floor above home, m, while it holds."""
        return self._behaviour.floor_m if self.above_floor else -inf

    def watch_floor(self, height_m: float, *, lands: bool) -> None:
        self.above_floor = not lands and (self.above_floor or height_m > self._behaviour.floor_m)

    def refusal(self, place: Vector) -> Refusal | None:
        return self._geofence.refusal(place) or self._around_home.refusal(place)

    @property
    def size(self) -> int:
        """Number of edges and circles."""
        return self._geofence.size + 1

    def first_outside(self, places: Sequence[Vector]) -> tuple[int, Refusal] | None:
        """Return the index of the first place outside, with the reason."""
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
        """Check the current position, at 10 Hz because polygons are slow."""
        if not self.exists:
            self._breach = self.against_arming = None
        elif now_us >= self._breach_due_us:
            self._breach_due_us, self._arming_margin_m = now_us + _LOOK_EVERY_US, margin_m
            before, self._breach = self._breach, self.refusal(place)
            if self._breach is not None and before is None:
                self._note(place, now_us)
            self.against_arming = self._breach or self.arming_refusal(place)
        return self._breach

    def _note(self, place: Vector, now_us: int) -> None:
        up_m, behaviour = place[2] - self._home.position_enu_m[2], self._behaviour
        too_high = 0.0 < behaviour.max_height_m < up_m
        kind = mav.FENCE_BREACH_MAXALT if too_high else mav.FENCE_BREACH_BOUNDARY
        self.breaches += 1
        self.breach_type = int(mav.FENCE_BREACH_MINALT if up_m < self.floor_m else kind)
        self.breached_us = now_us

    def arming_refusal(self, place: Vector) -> Refusal | None:
        """Check a position by the present fence, also just after it was loaded."""
        refusal, margin_m = self.refusal(place), self._arming_margin_m
        if refusal is None and margin_m > 0.0 and self.margin_m(place) < margin_m:
            return Refusal(f"within {margin_m:g} m (GF_MARGIN) of the geofence's edge")
        return refusal
