"""Mission items as phases."""

from collections.abc import Callable, Mapping
from math import dist, inf, isfinite, isnan, nan, pi, radians, remainder, tau
from typing import NamedTuple, TypeAlias

from colibri.autopilot.guidance.mission.items import height_of, is_here, place_of
from colibri.autopilot.guidance.tasks.orders import GoTo, Land, Orbit, Order, Return, TakeOff, turn_of
from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire.dialect import mav

MIN_RADIUS_M = MIN_TAKEOFF_M = 1.0
_TURNED_RAD = radians(5.0)
_TURN_WITHIN_S = 30.0


class MissionContext(NamedTuple):
    """State of the flight; `arrived` and `turns` refer to the previous order."""

    position_enu_m: Vector
    velocity_enu_m_s: Vector
    yaw_rad: float
    landed: bool
    arrived: bool
    turns: float
    home_enu_m: Vector
    origin: Geodetic
    unix_us: int = 0  # time, if items may name it


class Defaults(NamedTuple):
    """Numbers for items that leave them out; `face` is as `Behaviour.items_face`, `copter` as `copter_items`."""

    acceptance_m: float = 0.5
    takeoff_height_m: float = 2.5
    orbit_radius_m: float = 10.0
    face: bool | None = None
    copter: bool = False


class ItemContext(NamedTuple):
    mission_context: MissionContext
    defaults: Defaults
    order: Order
    speed_m_s: float | None

    def place(self, item: MissionItem) -> Vector:
        """Return the place of an item; 0, 0 is where the vehicle is going."""
        now, order = self.mission_context, self.order
        x, y, z = order.position_enu_m if isinstance(order, GoTo) else now.position_enu_m
        if not is_here(item):
            x, y, _ = place_of(item, now.home_enu_m, now.origin)
        keeps = self.defaults.copter and item.z == 0.0
        return (x, y, z if keeps else height_of(item, now.home_enu_m, now.origin))

    def yaw(self, item: MissionItem) -> float | None:
        """Return the heading of an item, rad; None is along its way."""
        if self.defaults.face is None and isfinite(item.p4):
            return remainder(0.5 * pi - radians(item.p4), tau)
        if self.defaults.face is not False:
            return None
        kept = self.order.yaw_rad if isinstance(self.order, GoTo) else None
        return self.mission_context.yaw_rad if kept is None else kept


EndCondition: TypeAlias = Callable[[MissionContext, float], bool]


class LegPhase(NamedTuple):
    """A part of an item: order (None keeps the previous), end condition, and whether it reaches the item."""

    order: Order | None
    ends: EndCondition
    reaches: bool = False


Leg: TypeAlias = Callable[[MissionItem, ItemContext], tuple[LegPhase, ...]]


def phases_of(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    leg = _LEGS.get(item.command)
    return () if leg is None else leg(item, context)


def _waypoint(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    return _there(item, context, _or_zero(item.p1), item.p2 if item.p2 > 0.0 else None)


def _there(
    item: MissionItem, context: ItemContext, stay_s: float, radius_m: float | None = None
) -> tuple[LegPhase, ...]:
    place, radius_m = context.place(item), context.defaults.acceptance_m if radius_m is None else radius_m
    go = GoTo(place, context.yaw(item), context.speed_m_s)
    climb = _off_the_ground(place[2], context)
    stay = (LegPhase(None, _after(stay_s)),) if stay_s > 0.0 else ()
    return (*climb, LegPhase(go, _within(place, radius_m), reaches=True), *stay)


def _circle(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    center = context.place(item)
    radius = item.p3 if abs(item.p3) > 0.0 else context.defaults.orbit_radius_m
    radius = max(radius, MIN_RADIUS_M) if radius > 0.0 else min(radius, -MIN_RADIUS_M)
    turns = 1.0 if isnan(item.p1) else item.p1
    order = Orbit(center, radius, context.speed_m_s, mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER)
    around = LegPhase(order, lambda now, _: abs(now.turns) >= turns, reaches=True)
    return (*_off_the_ground(center[2], context), around)


def _take_off(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    mission_context, defaults = context.mission_context, context.defaults
    here_m = mission_context.position_enu_m[2]
    height = height_of(item, mission_context.home_enu_m, mission_context.origin)
    if mission_context.landed and height <= here_m:
        height = here_m + MIN_TAKEOFF_M
    yaw = context.yaw(item)
    near_m = min(defaults.acceptance_m, 0.1 * (height - here_m)) if defaults.copter else defaults.acceptance_m
    high = here_m >= height - near_m and not mission_context.landed
    up = () if high else (LegPhase(TakeOff(height, yaw), _above(height - near_m)),)
    if is_here(item):
        return (*up[:-1], *(phase._replace(reaches=True) for phase in up[-1:]))
    place = context.place(item)
    go = GoTo(place, yaw, context.speed_m_s)
    return (*up, LegPhase(go, _within(place, defaults.acceptance_m), reaches=True))


def _land(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    place = None if is_here(item) else context.place(item)
    return (LegPhase(Land(place, context.yaw(item)), _landed, reaches=True),)


def _delay(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    unix_us = context.mission_context.unix_us
    absolute = unix_us and item.command == mav.MAV_CMD_NAV_DELAY and not item.p1 > 0.0
    wait_s = _until(item, unix_us * 1e-6) if absolute else _or_zero(item.p1)
    return (LegPhase(None, _after(wait_s), reaches=True),)


def _until(item: MissionItem, unix_s: float) -> float:
    """Return the time until UTC is p2 hours, p3 minutes, p4 seconds, s; -1 is any."""
    hours, minutes, seconds = item.p2, item.p3, item.p4
    period_s = 86_400.0 if hours >= 0.0 else 3600.0 if minutes >= 0.0 else 60.0
    return (max(hours, 0.0) * 3600.0 + max(minutes, 0.0) * 60.0 + max(seconds, 0.0) - unix_s) % period_s


def _turn(item: MissionItem, context: ItemContext) -> tuple[LegPhase, ...]:
    """Turn to an angle clockwise from north, or from the heading if p4 is 1; p3 is the way, 1 clockwise."""
    mission_context = context.mission_context
    if mission_context.landed:
        return ()
    angle = radians(item.p1)
    yaw = remainder(0.5 * pi - angle, tau)
    if item.p4 == 1.0:
        yaw = remainder(mission_context.yaw_rad - (-angle if item.p3 < 0.0 else angle), tau)
    place = context.order.position_enu_m if isinstance(context.order, GoTo) else mission_context.position_enu_m

    def turned(now: MissionContext, since_s: float) -> bool:
        return abs(remainder(now.yaw_rad - yaw, tau)) <= _TURNED_RAD or since_s >= _TURN_WITHIN_S

    turn = turn_of(item.p1, _or_zero(item.p3))
    return (LegPhase(GoTo(place, yaw, context.speed_m_s, turn), turned, reaches=True),)


_LEGS: Mapping[int, Leg] = {
    mav.MAV_CMD_NAV_WAYPOINT: _waypoint,
    mav.MAV_CMD_NAV_SPLINE_WAYPOINT: _waypoint,
    mav.MAV_CMD_NAV_LOITER_UNLIM: lambda item, context: _there(item, context, inf),
    mav.MAV_CMD_NAV_LOITER_TIME: lambda item, context: _there(item, context, _or_zero(item.p1)),
    mav.MAV_CMD_NAV_LOITER_TURNS: _circle,
    # A multicopter climbs on the way: it is at the height when it is there.
    mav.MAV_CMD_NAV_LOITER_TO_ALT: lambda item, context: _there(item._replace(p4=nan), context, 0.0),
    mav.MAV_CMD_NAV_TAKEOFF: _take_off,
    mav.MAV_CMD_NAV_VTOL_TAKEOFF: _take_off,
    mav.MAV_CMD_NAV_LAND: _land,
    mav.MAV_CMD_NAV_VTOL_LAND: _land,
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda *_: (LegPhase(Return(), _landed, reaches=True),),
    mav.MAV_CMD_NAV_DELAY: _delay,
    mav.MAV_CMD_CONDITION_DELAY: _delay,
    mav.MAV_CMD_CONDITION_YAW: _turn,
}


def _off_the_ground(height_m: float, context: ItemContext) -> tuple[LegPhase, ...]:
    mission_context, defaults = context.mission_context, context.defaults
    if not mission_context.landed:
        return ()
    up = max(height_m, mission_context.position_enu_m[2] + defaults.takeoff_height_m)
    return (LegPhase(TakeOff(up), _above(up - defaults.acceptance_m)),)


def _or_zero(value: float) -> float:
    return 0.0 if isnan(value) else value


def _within(place: Vector, radius_m: float) -> EndCondition:
    return lambda now, _: now.arrived or dist(now.position_enu_m, place) <= radius_m


def _above(height_m: float) -> EndCondition:
    return lambda now, _: now.arrived or now.position_enu_m[2] >= height_m


def _after(wait_s: float) -> EndCondition:
    return lambda _, since_s: since_s >= wait_s


def _landed(now: MissionContext, _since_s: float) -> bool:
    return now.landed
