from math import hypot

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.tasks.follow import ABOVE_TARGET, MIN_HEIGHT_M
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, geodetic_of
from colibri.mavlink.wire.dialect import mav
from tools.harness.copter_flight import CopterFlight

DISTANCE_M, HEIGHT_M = 2.0, 8.0
STILL = (0.0, 0.0, 0.0)


def _follow(flown: CopterFlight, east_m: float, north_m: float, up_m: float, seconds: int) -> None:
    """Be the target, at a place, for so long."""
    place = geodetic_of((east_m, north_m, up_m), DEFAULT_ORIGIN)
    where = (round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7), place.altitude_m)
    for _ in range(seconds):
        flown.send("FOLLOW_TARGET", 0, 1, *where, STILL, STILL, (1.0, 0.0, 0.0, 0.0), STILL, STILL, 0)
        flown.run(1.0)


@pytest.mark.parametrize(
    ("above", "target_up_m", "height_m"),
    [(0, 3.0, HEIGHT_M), (ABOVE_TARGET, 3.0, 3.0 + HEIGHT_M), (ABOVE_TARGET, -HEIGHT_M, MIN_HEIGHT_M)],
    ids=["above home", "above the target", "never into the ground"],
)
def test_the_target_is_followed_at_its_distance(above: int, target_up_m: float, height_m: float) -> None:
    flown = CopterFlight()
    for name, value in (("FLW_TGT_DST", DISTANCE_M), ("FLW_TGT_HT", HEIGHT_M), ("FLW_TGT_ALT_M", above)):
        flown.set_param(name, value)
    flown.takeoff()
    assert flown.select(Mode.FOLLOW) == mav.MAV_RESULT_ACCEPTED
    _follow(flown, 10.0, 0.0, target_up_m, seconds=10)
    assert flown.mode is Mode.FOLLOW
    east, north, up = flown.position
    assert hypot(east - 10.0, north) == pytest.approx(DISTANCE_M, abs=0.1)
    assert up == pytest.approx(height_m, abs=0.1)
