"""Test a mission's end in pytest: `pytest test_return.py` flies three times, each in a turbulence of its own.

Prints:
    3 passed
"""

import pytest


@pytest.mark.wind("6@270", turbulence="light")
@pytest.mark.seeds(1, 2)
def test_comes_home(sitl):
    sitl.set_param("RTL_RETURN_ALT", 4.0)
    sitl.takeoff(3)
    sitl.goto(6, 2, 4)
    sitl.select("return")
    sitl.wait_until(lambda: not sitl.armed, within=60, what="the landing")
    assert sitl.position == pytest.approx((0, 0, 0), abs=0.3)


@pytest.mark.sitl(airborne=5.0)
def test_hovers_on_a_weak_rotor(sitl):
    sitl.set_param("SYS_FAILURE_EN", 1)
    sitl.inject("motor", "wrong", 1, 0.8)  # 80 % of its thrust
    sitl.hold(lambda: sitl.is_at((0, 0, 5), near_m=0.5), for_=5, what="height and place")
