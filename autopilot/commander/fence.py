"""The fence in flight: the geofence that was uploaded, and the one around home that parameters draw."""

from collections.abc import Sequence

from colibri.autopilot.commander.home import Home
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.geofence import AroundHome, Geofence
from colibri.common.types import Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire.refusal import Refusal

_LOOK_EVERY_US = 100_000


class Fence:
    """The fences of one vehicle."""

    def __init__(self, home: Home, behaviour: Behaviour) -> None:
        self._home = home
        self._behaviour = behaviour
        self._items: tuple[MissionItem, ...] = ()
        self._geofence = Geofence((), home.origin)
        self._breach: Refusal | None = None
        self._breach_due_us = 0

    def adopt(self, behaviour: Behaviour) -> None:
        """Adopt other numbers."""
        self._behaviour = behaviour

    def load(self, items: Sequence[MissionItem]) -> None:
        """Replace the geofence by one of valid items; none where there are none."""
        self._items = tuple(items)
        self.rebuild()

    def rebuild(self) -> None:
        """Build the geofence about the origin as it is now."""
        self._geofence = Geofence(self._items, self._home.origin)
        self._breach, self._breach_due_us = None, 0

    @property
    def exists(self) -> bool:
        """Whether there is a fence, uploaded or around home."""
        behaviour = self._behaviour
        return bool(self._items) or behaviour.max_distance_m > 0.0 or behaviour.max_height_m > 0.0

    @property
    def _around_home(self) -> AroundHome:
        behaviour = self._behaviour
        return AroundHome(self._home.position_enu_m, behaviour.max_distance_m, behaviour.max_height_m)

    def refusal(self, place: Vector) -> Refusal | None:
        """Return why the vehicle may not fly to a place; None if it may."""
        return self._geofence.refusal(place) or self._around_home.refusal(place)

    def margin_m(self, place: Vector) -> float:
        """Return how far a place is inside of every fence, m; negative outside."""
        return min(self._geofence.margin_m(place), self._around_home.margin_m(place))

    def breach(self, place: Vector, now_us: int) -> Refusal | None:
        """Return why the vehicle may not be where it is; judged ten times a second, fences take time."""
        if not self.exists:
            self._breach = None
        elif now_us >= self._breach_due_us:
            self._breach_due_us = now_us + _LOOK_EVERY_US
            self._breach = self.refusal(place)
        return self._breach
