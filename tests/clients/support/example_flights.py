"""What the vehicle must have done for MAVSDK-Python's examples that fly; each judge waits for what is still to come."""

from dataclasses import dataclass
from math import atan2, degrees, pi, radians
from pathlib import Path

import numpy as np

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.types import Vector
from tests.clients.support.client import Client
from tests.clients.support.geometry import (
    away_m,
    closest_m,
    during,
    heading_deg,
    place,
    speed_m_s,
    swept_rad,
    turned_rad,
)
from tools.harness.observer import Observer, Sight

HOME: Vector = (0.0, 0.0, 0.0)
IRCHEL = ((47.398039859999997, 8.5455725400000002), (47.398036222362471, 8.5450146439425509))
IRCHEL_LAST = (47.397825620791885, 8.5450092830163271)


@dataclass(frozen=True, slots=True)
class Evidence:
    seen: Observer
    client: Client
    state: Path


def lands(evidence: Evidence, where: Vector | None = None) -> None:
    landed = evidence.seen.wait(lambda sight: not sight.flying and not sight.armed, "a landing", 120.0)
    assert any(sight.flying for sight in evidence.seen.sights), "it never flew"
    if where is not None:
        assert away_m(landed, where) < 0.5, f"landed at {landed.position_enu_m}"


def takeoff_and_land(evidence: Evidence) -> None:
    """Up to the 2.5 m of MIS_TAKEOFF_ALT, then down at the same place."""
    lands(evidence, HOME)
    assert evidence.seen.modes()[-3:] == [Mode.TAKEOFF, Mode.HOLD, Mode.LAND], evidence.seen.modes()
    assert abs(_max_height_m(evidence.seen.sights) - 2.5) < 0.3


def telemetry_takeoff_and_land(evidence: Evidence) -> None:
    """Up to the 10 m that the script sets, as it prints, then down."""
    lands(evidence, HOME)
    assert abs(_max_height_m(evidence.seen.sights) - 10.0) < 0.5
    assert evidence.seen.parameter("MIS_TAKEOFF_ALT") == 10.0
    for line in ("Altitude: 10", "Flight mode: TAKEOFF", "Flight mode: LAND"):
        evidence.client.wait_printed(line)


def goto(evidence: Evidence) -> None:
    """At the place, 20 m above the ground, and stays."""
    where = place(47.397606, 8.543060, 20.0)
    evidence.seen.wait(lambda sight: away_m(sight, where) < 0.3 and speed_m_s(sight) < 0.1, "the place", 120.0)
    assert evidence.seen.now.mode is Mode.HOLD
    assert abs(heading_deg(evidence.seen.now)) < 5.0


def do_orbit(evidence: Evidence) -> None:
    """A whole turn 10 m around the centre, looking at it, 2 m/s fast, 10 m high; then home."""
    center = place(*IRCHEL[1], 10.0)
    lands(evidence, HOME)
    circle = [
        sight
        for sight in evidence.seen.in_mode(Mode.ORBIT)
        if abs(speed_m_s(sight) - 2.0) < 0.2 and _off_circle_m(sight, center, 10.0) < 1.0
    ]
    circle = [sight for sight in circle if sight.time_s > circle[0].time_s + 3.0]
    assert abs(swept_rad(circle, center)) > 2.0 * pi
    assert max(_off_circle_m(sight, center, 10.0) for sight in circle) < 0.3
    assert max(abs(sight.height_m - 10.0) for sight in circle) < 0.3
    assert max(abs(turned_rad(sight.euler_rad[2] - _bearing(sight, center))) for sight in circle) < 0.2
    assert evidence.seen.modes()[-1] is Mode.RETURN


def mission(evidence: Evidence) -> None:
    """Past the three places within the 3 m that MAVSDK requires, 25 m high, at most 10 m/s fast; then home."""
    lands(evidence, HOME)
    for latitude, longitude in (*IRCHEL, IRCHEL_LAST):
        assert closest_m(evidence.seen.sights, place(latitude, longitude, 25.0)) < 3.0
    assert max(map(speed_m_s, evidence.seen.in_mode(Mode.MISSION))) < 10.5
    assert evidence.seen.modes()[-1] is Mode.RETURN
    evidence.client.wait_printed(r"Mission progress: (\d+)/\1\b")


def offboard_position_ned(evidence: Evidence) -> None:
    """At each of the setpoints, facing as commanded, and on the ground at the last."""
    sights = evidence.seen.in_mode(Mode.OFFBOARD)
    for where, heading in (((0.0, 0.0, 5.0), 0.0), ((0.0, 5.0, 5.0), 90.0), ((10.0, 5.0, 5.0), 90.0)):
        assert any(away_m(s, where) < 0.2 and _off_deg(s, heading) < 2.0 for s in sights), where
    assert closest_m(evidence.seen.sights, (10.0, 0.0, 0.0)) < 0.5


def offboard_velocity_ned(evidence: Evidence) -> None:
    """Each of the velocities, facing as commanded: within 3 degrees after 4 s, and 10 where the script leaves it 2."""
    sights = evidence.seen.in_mode(Mode.OFFBOARD)
    demanded: tuple[tuple[Vector, float, float], ...] = (
        ((0.0, 0.0, 2.0), 0.0, 3.0),
        ((0.0, 2.0, 0.0), 90.0, 3.0),
        ((0.0, -2.0, 0.0), -90.0, 3.0),
        ((-2.0, 0.0, 0.0), 90.0, 3.0),
        ((2.0, 0.0, 0.0), 90.0, 3.0),
        ((0.0, 0.0, 0.0), 180.0, 10.0),  # a quarter turn at no more than 60 degrees a second
        ((0.0, 0.0, -1.0), 0.0, 3.0),
    )
    for velocity, heading, off in demanded:
        assert any(_off_m_s(s, velocity) < 0.2 and _off_deg(s, heading) < off for s in sights), (velocity, heading)


def offboard_velocity_body(evidence: Evidence) -> None:
    """Turns of 60 degrees a second; then two circles at 5 m/s and 30 degrees a second, ahead and to the left."""
    sights = evidence.seen.in_mode(Mode.OFFBOARD)
    rates = [-degrees(sight.rate_flu_rad_s[2]) for sight in sights]
    assert abs(max(rates) - 60.0) < 3.0
    assert abs(min(rates) + 60.0) < 3.0
    circling = [s for s in sights if speed_m_s(s) > 4.8 and abs(degrees(s.rate_flu_rad_s[2]) + 30.0) < 3.0]
    for side_deg in (0.0, -90.0):
        part = [s for s in circling if _between_deg(_course_deg(s), heading_deg(s) + side_deg) < 20.0]
        assert part[-1].time_s - part[0].time_s > 10.0, side_deg
        assert max(speed_m_s(s) for s in part) < 5.3
        steady = during(part, part[0].time_s + 2.0, part[-1].time_s)
        assert _off_any_circle_m(steady, 5.0 / (pi / 6.0)) < 0.2, side_deg


def offboard_position_velocity_ned(evidence: Evidence) -> None:
    """Climbs to 10 m and goes north; then lands."""
    sights = evidence.seen.in_mode(Mode.OFFBOARD)
    assert closest_m(sights, (0.0, 0.0, 10.0)) < 0.5
    assert max(s.position_enu_m[1] for s in sights) > 15.0
    assert max(abs(s.position_enu_m[0]) for s in sights) < 0.3


def offboard_attitude(evidence: Evidence) -> None:
    """Rises; rolls 30 degrees to the right, then to the left; then comes down.

    Thrust of 0.6 is hover for the vehicle that it was written for, and 1.7 g for this one: the way down is long.
    """
    evidence.seen.wait(lambda sight: sight.mode is Mode.LAND and sight.velocity_enu_m_s[2] < -1.0, "the way down", 60.0)
    sights = evidence.seen.in_mode(Mode.OFFBOARD)
    rolls = [degrees(s.euler_rad[0]) for s in sights]
    assert abs(max(rolls) - 30.0) < 3.0
    assert abs(min(rolls) + 30.0) < 3.0
    assert max(s.velocity_enu_m_s[2] for s in sights) > 1.0
    assert max(abs(degrees(s.euler_rad[1])) for s in sights) < 3.0


def manual_control(evidence: Evidence) -> None:
    """In position mode for 10 s, moved by the sticks."""
    begun = evidence.seen.wait(lambda sight: sight.mode is Mode.POSITION, "position mode", 60.0)
    evidence.seen.wait(lambda sight: sight.time_s > begun.time_s + 10.0, "10 s of it", 60.0)
    steered = during(evidence.seen.sights, begun.time_s, begun.time_s + 10.0)
    assert {sight.mode for sight in steered} == {Mode.POSITION}
    assert all(sight.armed for sight in steered)
    assert max(map(speed_m_s, steered)) > 0.1
    assert max(abs(sight.rate_flu_rad_s[2]) for sight in steered) > 0.05


def follow_me(evidence: Evidence) -> None:
    """Flies to the reported position of the target, 2 m from it; then lands."""
    lands(evidence)
    sights = evidence.seen.in_mode(Mode.FOLLOW)
    latitude, longitude = IRCHEL[0]
    target = place(latitude, longitude, 0.0)
    away = [away_m(sight._replace(position_enu_m=(*sight.position_enu_m[:2], 0.0)), target) for sight in sights]
    assert away[0] - min(away) > 5.0
    assert min(sight.height_m for sight in sights) > 0.5


def failure_injection(evidence: Evidence) -> None:
    """Climbs by 20 m, loses its GPS while SYS_FAILURE_EN is set, and stays where it is."""
    assert evidence.seen.fix < 2
    now = evidence.seen.now
    assert now.flying
    assert away_m(now, (0.0, 0.0, 22.5)) < 0.5
    assert evidence.seen.parameter("SYS_FAILURE_EN") == 0.0


def _max_height_m(sights: list[Sight]) -> float:
    return max(sight.height_m for sight in sights)


def _bearing(sight: Sight, where: Vector) -> float:
    return atan2(where[1] - sight.position_enu_m[1], where[0] - sight.position_enu_m[0])


def _off_circle_m(sight: Sight, center: Vector, radius_m: float) -> float:
    x, y, _ = sight.position_enu_m
    return abs(away_m(sight._replace(position_enu_m=(x, y, center[2])), center) - radius_m)


def _off_m_s(sight: Sight, velocity: Vector) -> float:
    return away_m(sight._replace(position_enu_m=sight.velocity_enu_m_s), velocity)


def _off_deg(sight: Sight, heading: float) -> float:
    return _between_deg(heading_deg(sight), heading)


def _between_deg(one: float, other: float) -> float:
    return abs(degrees(turned_rad(radians(one - other))))


def _course_deg(sight: Sight) -> float:
    return 90.0 - degrees(atan2(sight.velocity_enu_m_s[1], sight.velocity_enu_m_s[0]))


def _off_any_circle_m(sights: list[Sight], radius_m: float) -> float:
    """Return how far the way is from a circle of that radius around the centre that fits best; an arc is enough."""
    x, y = (np.array([sight.position_enu_m[axis] for sight in sights]) for axis in (0, 1))
    rows = np.stack([2.0 * x, 2.0 * y, np.ones_like(x)], axis=1)
    center_x, center_y, _ = np.linalg.lstsq(rows, x**2 + y**2)[0]
    return float(np.abs(np.hypot(x - center_x, y - center_y) - radius_m).max())
