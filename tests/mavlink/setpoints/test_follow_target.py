from math import isfinite, nan
from typing import Any

import pytest
from hypothesis import given

from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.mavlink.setpoints.follow_target import GOES_ON_US, Follow
from colibri.mavlink.setpoints.setpoints import TargetState
from tests.support.streamed import FIRST, message, messages

ORIGIN = Geodetic(47.0, 8.0, 400.0)
UNKNOWN = [nan, nan, nan]


@pytest.fixture
def follow() -> Follow:
    service = Follow()
    service.update(ORIGIN)
    return service


def tell(service: Follow, peer: Any = FIRST, now_us: int = 0, **changes: Any) -> None:
    there = geodetic_of((100.0, -50.0, 0.0), ORIGIN)
    fields = {
        "est_capabilities": 1,
        "lat": round(there.latitude_deg * 1e7),
        "lon": round(there.longitude_deg * 1e7),
        "alt": 410.0,
        "vel": [2.0, 1.0, -0.5],
        "acc": UNKNOWN,
        "attitude_q": [1.0, nan, nan, nan],
        "rates": UNKNOWN,
        "position_cov": UNKNOWN,
    }
    service.receive(message("FOLLOW_TARGET", **{**fields, **changes}), peer, now_us)


def latest(service: Follow, now_us: int, timeout_us: int = 10**9) -> TargetState:
    target = service.latest(now_us, timeout_us)
    assert target is not None
    return target


def test_a_target_in_enu(follow: Follow) -> None:
    tell(follow, now_us=5_000)
    target = latest(follow, 5_000)
    assert target.position_enu_m == pytest.approx((100.0, -50.0, 10.0), abs=0.02)
    assert target.velocity_enu_m_s == (1.0, 2.0, 0.5)
    assert target.acceleration_enu_m_s2 == (0.0, 0.0, 0.0)
    assert target.received_us == 5_000


def test_it_goes_on_at_its_velocity_up_to_a_bound(follow: Follow) -> None:
    tell(follow)
    here, later = latest(follow, 0), latest(follow, 1_500_000)
    assert later.position_enu_m == pytest.approx([p + 1.5 * v for p, v in zip(*here[:2], strict=True)])
    assert later.velocity_enu_m_s == here.velocity_enu_m_s
    last, beyond = latest(follow, GOES_ON_US), latest(follow, 10 * GOES_ON_US)
    assert beyond.position_enu_m == pytest.approx(last.position_enu_m)
    assert beyond.velocity_enu_m_s == (0.0, 0.0, 0.0)
    assert last.velocity_enu_m_s == here.velocity_enu_m_s


def test_it_grows_old(follow: Follow) -> None:
    tell(follow)
    assert follow.latest(1_000_000, 1_000_000) is not None
    assert follow.latest(1_000_001, 1_000_000) is None


def test_velocities_that_are_not_known_are_zero(follow: Follow) -> None:
    tell(follow, vel=[nan, 1.0, 1.0])
    assert latest(follow, 0).velocity_enu_m_s == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"est_capabilities": 2}, "no position"),
        ({"alt": nan}, "not finite"),
        ({"vel": [0.0, float("inf"), 0.0]}, "not finite"),
        ({"lat": 2**31 - 1}, "out of range"),
        ({"lat": 0, "lon": 0}, "out of range"),
        ({"alt": 1e9}, "out of range"),
        ({"vel": [80.0, 80.0, 0.0]}, "out of range"),
        ({"acc": [0.0, 0.0, 101.0]}, "out of range"),
    ],
)
def test_what_is_no_target_is_dropped(follow: Follow, changes: dict[str, Any], reason: str) -> None:
    tell(follow, **changes)
    assert follow.latest(0, 10**9) is None
    assert follow.dropped == {reason: 1}


@given(messages("FOLLOW_TARGET"))
def test_whatever_the_fields_hold(received: Any) -> None:
    follow = Follow()
    assert list(follow.receive(received, FIRST, 0)) == []
    target = follow.latest(3_000_000, 10**9)
    if target is not None:
        assert all(map(isfinite, (*target.position_enu_m, *target.velocity_enu_m_s, *target.acceleration_enu_m_s2)))
