"""Ground or air, by forces alone."""

import pytest

from colibri.autopilot.control.interface import AT_REST
from colibri.autopilot.guidance.landing_detector import Held, Lack, Scrape, is_touching

_INTERVAL_S = 0.01


@pytest.mark.parametrize(
    ("lift", "climb_m_s", "gain_m_s2", "within_s"),
    [
        (0.5, -0.6, 0.0, 0.7),  # on its feet
        (0.0, -0.7, -1.0, 0.3),  # on its feet, under an estimate that sinks faster
        (0.0, 3.0, -9.8, None),  # thrown up
        (0.0, 2.5, 0.0, None),  # climbs on
        (0.5, 0.0, -4.9, None),  # falls
        (0.9, -0.7, 0.0, None),  # descends
    ],
)
def test_ground_carries_what_lacks_lift(
    lift: float, climb_m_s: float, gain_m_s2: float, within_s: float | None
) -> None:
    lack, carried_s = Lack(), None
    for sample in range(90):
        now_m_s = climb_m_s + gain_m_s2 * sample * _INTERVAL_S
        lack = lack.after(lift, now_m_s, _INTERVAL_S)
        if carried_s is None and lack.is_carried(now_m_s):
            carried_s = sample * _INTERVAL_S
    assert (carried_s is None) if within_s is None else (carried_s is not None and carried_s < within_s)


@pytest.mark.parametrize(
    ("push", "jolt_s", "height_m", "touches"),
    [(0.8, 0.0, 0.4, True), (0.0, 0.1, 0.4, True), (0.2, 0.02, 0.0, False), (0.8, 0.1, 5.0, False)],
)
def test_feet_push_and_jolt_near_the_ground_only(push: float, jolt_s: float, height_m: float, touches: bool) -> None:
    state = AT_REST._replace(position_enu_m=(0.0, 0.0, height_m))
    assert is_touching(push, jolt_s, state, 0.0) is touches


@pytest.mark.parametrize(
    ("wanted_m", "climb_m_s", "holds"), [(-5.0, 0.0, True), (-0.5, 0.0, False), (-5.0, -0.2, False)]
)
def test_a_vehicle_that_rocks_above_a_sinking_reference_stands(wanted_m: float, climb_m_s: float, holds: bool) -> None:
    held = Held()
    for sample in range(520):
        rocks_m = 0.1 * (sample % 3) + climb_m_s * sample * _INTERVAL_S
        held = held.after(sample * 10_000, wanted_m, AT_REST._replace(position_enu_m=(0.0, 0.0, rocks_m)))
    assert held.is_long(5_200_000) is holds


@pytest.mark.parametrize(
    ("speed_m_s", "height_m", "wanted_m", "scrapes"),
    [(5.0, 0.05, 3.0, True), (5.0, 0.05, 0.1, False), (5.0, 0.5, 3.0, False), (2.0, 0.05, 3.0, False)],
)
def test_only_a_fast_vehicle_that_should_be_higher_scrapes(
    speed_m_s: float, height_m: float, wanted_m: float, scrapes: bool
) -> None:
    scrape, state = Scrape(), AT_REST._replace(position_enu_m=(0.0, 0.0, height_m))
    for sample in range(60):
        moving = state._replace(velocity_enu_m_s=(speed_m_s, 0.0, 0.1 * (sample % 3 - 1)))
        scrape = scrape.after(sample * 10_000, wanted_m, moving, 0.0)
    assert scrape.is_long(600_000) is scrapes
