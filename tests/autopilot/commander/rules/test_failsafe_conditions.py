"""Since when each condition of the failsafes holds."""

from math import inf, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.commander.rules.failsafe_conditions import (
    HOLDS,
    SENSORS,
    SILENT_SINCE,
    Conditions,
    FailsafeInputs,
    battery_below,
    needs_position,
    position_known,
    stopping_m,
)
from colibri.autopilot.commander.rules.failsafe_parameters import NUMBERS
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import Diagnostics, Fallback, VehicleState
from colibri.autopilot.estimation.estimate import Estimate, Health
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, PositionSetpoint
from tests.support.failsafe_inputs import FULL, LOST, WELL

LIMITS = {number.name: float(number.default) for number in NUMBERS}
NOW_US = 10_000_000
NOTHING = (0.0, 0.0, 0.0)


KNOWN = Health(*(True,) * 6, False, None, False, *(True,) * 4, ())


def estimated(health: Health) -> Estimate:
    frame = StateFrame(NOW_US, NOTHING, NOTHING, (1.0, 0.0, 0.0, 0.0), NOTHING)
    return Estimate(frame, *(NOTHING,) * 5, health, {}, {}, 0, NOTHING, None)


def at_speed(velocity: Vector, position: Vector = (0.0, 0.0, 5.0)) -> VehicleState:
    return WELL.state._replace(velocity_enu_m_s=velocity, position_enu_m=position)


def test_every_condition_has_one_rule() -> None:
    assert sorted([*HOLDS, *SILENT_SINCE, *SENSORS]) == sorted(Condition)


def test_of_a_vehicle_that_is_well_nothing_is_lost() -> None:
    assert Conditions().look(WELL, LIMITS, ()) == {}


BEGUN = [
    *((condition, inputs) for condition, inputs in LOST.items() if condition in HOLDS),
    (Condition.TILTED, WELL._replace(state=WELL.state._replace(euler=(0.0, -1.5, 0.0)))),
]


@pytest.mark.parametrize(("condition", "inputs"), BEGUN, ids=[condition for condition, _ in BEGUN])
def test_what_begins_to_hold_holds_since_then(condition: Condition, inputs: FailsafeInputs) -> None:
    conditions = Conditions()
    assert conditions.look(inputs, LIMITS, ())[condition] == NOW_US
    assert conditions.look(inputs._replace(now_us=NOW_US + 8000), LIMITS, ())[condition] == NOW_US
    assert condition not in conditions.look(WELL._replace(now_us=NOW_US + 16000), LIMITS, ())
    assert conditions.look(inputs._replace(now_us=NOW_US + 24000), LIMITS, ())[condition] == NOW_US + 24000


HEARD_US = 9_000_000
SILENT = [
    (Condition.TELEMETRY_MISSED, WELL._replace(missed_us=HEARD_US)),
    (Condition.STATION_LOST, WELL._replace(station_us=HEARD_US)),
    (Condition.STICKS_LOST, WELL._replace(mode=Mode.ALTITUDE, sticks_us=HEARD_US)),
    (Condition.SETPOINTS_LOST, WELL._replace(mode=Mode.OFFBOARD, setpoint=PositionSetpoint(time_us=HEARD_US))),
]


@pytest.mark.parametrize(("condition", "inputs"), SILENT, ids=[condition for condition, _ in SILENT])
def test_what_is_silent_is_so_since_it_was_heard_last(condition: Condition, inputs: FailsafeInputs) -> None:
    assert Conditions().look(inputs, LIMITS, ()) == {condition: HEARD_US}


@pytest.mark.parametrize("condition", [Condition.STICKS_LOST, Condition.SETPOINTS_LOST])
def test_an_unneeded_stream_stays_lost_only_if_lost_before(condition: Condition) -> None:
    inputs = WELL._replace(sticks_us=HEARD_US, setpoint=PositionSetpoint(time_us=HEARD_US))
    assert condition not in Conditions().look(inputs, LIMITS, ())
    assert Conditions().look(inputs, LIMITS, (condition,))[condition] == HEARD_US


def test_one_that_was_ended_has_been_silent_for_ever() -> None:
    assert Conditions().look(WELL._replace(mode=Mode.POSITION), LIMITS, ())[Condition.STICKS_LOST] < -NOW_US


def test_after_a_restart_there_is_time_to_be_heard() -> None:
    inputs = WELL._replace(mode=Mode.OFFBOARD, listening_us=NOW_US - 8000)
    assert Conditions().look(inputs, LIMITS, ())[Condition.SETPOINTS_LOST] == NOW_US - 8000


def test_recovery_is_no_failure_of_the_plan() -> None:
    inputs = WELL._replace(decided=Diagnostics(fallback=Fallback.RECOVERY))
    assert Conditions().look(inputs, LIMITS, ()) == {}


def test_the_same_state_lies_only_where_it_says_that_it_moves() -> None:
    for velocity, lies in (((0.0, 0.0, 0.0), False), ((0.01, 0.0, 0.0), False), ((0.5, 0.0, 0.0), True)):
        conditions = Conditions()
        found = [
            conditions.look(WELL._replace(now_us=NOW_US + k * 8000, state=at_speed(velocity)), LIMITS, ())
            for k in range(60)
        ]
        assert (found[-1].get(Condition.ATTITUDE_LOST) == NOW_US) is lies


def test_voltage_is_looked_at_where_it_has_a_limit() -> None:
    assert not battery_below(None, 1.0, 12.6)
    assert not battery_below(FULL, 0.15, 0.0)
    assert battery_below(FULL, 0.15, 12.1)
    assert battery_below(FULL, 0.95, 0.0)


def test_a_vehicle_caught_in_a_fall_may_find_its_attitude() -> None:
    lost = WELL._replace(estimate=estimated(KNOWN._replace(attitude=False)))
    assert Condition.ATTITUDE_LOST in Conditions().look(lost, LIMITS, ())
    assert Condition.ATTITUDE_LOST not in Conditions().look(lost._replace(caught=True), LIMITS, ())


@pytest.mark.parametrize(
    ("lost_for_s", "unused", "known"),
    [(None, ("barometer",), True), (9.0, (), True), (9.0, ("barometer",), False), (11.0, (), False)],
)
def test_a_speed_that_was_integrated_for_long_is_unknown(
    lost_for_s: float | None, unused: tuple[str, ...], known: bool
) -> None:
    since_us = None if lost_for_s is None else NOW_US - round(lost_for_s * 1e6)
    health = KNOWN._replace(gps_lost_since_us=since_us, not_accepted=unused)
    assert estimated(health).speed_known is known


@pytest.mark.parametrize(("position_m", "velocity_m_s"), [(1e3, 0.1), (0.1, 1e3)])
def test_position_is_known_if_both_deviations_are_small(position_m: float, velocity_m_s: float) -> None:
    small = (0.1, 0.1, 1e3)
    sure = estimated(KNOWN)._replace(position_std_m=small, velocity_std_m_s=small)
    assert position_known(sure, LIMITS)
    unsure = sure._replace(position_std_m=(0.1, position_m, 0.1), velocity_std_m_s=(velocity_m_s, 0.1, 0.1))
    assert not position_known(unsure, LIMITS)
    assert Conditions().look(WELL._replace(estimate=unsure), LIMITS, ())[Condition.POSITION_LOST] == NOW_US


def test_who_is_steered_by_attitude_needs_no_position() -> None:
    attitude = AttitudeSetpoint((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.5)
    assert not needs_position(Mode.STABILIZED, None)
    assert not needs_position(Mode.OFFBOARD, attitude)
    assert needs_position(Mode.OFFBOARD, PositionSetpoint())
    assert needs_position(Mode.HOLD, attitude)


@given(st.floats(0.0, 12.0), st.floats(0.5, 10.0), st.floats(1.0, 60.0))
def test_stopping_distance_has_bounded_acceleration_and_jerk(speed: float, maximum: float, jerk: float) -> None:
    """Integrated: the acceleration rises to its bound, or to half of the change, and falls again."""
    peak = min(maximum, sqrt(speed * jerk))
    rise_s, flat_s = peak / jerk, (speed / peak - peak / jerk) if peak > 0.0 else 0.0
    way, v, a, dt = 0.0, speed, 0.0, 1e-3
    duration_s = 2.0 * rise_s + max(flat_s, 0.0)
    for step in range(int(duration_s / dt) + 1):
        t = step * dt
        a = min(jerk * t, peak, max(jerk * (duration_s - t), 0.0))
        way += max(v, 0.0) * dt
        v -= a * dt
    assert stopping_m(speed, maximum, jerk) == pytest.approx(way, abs=0.02 * speed + 1e-3)


def test_a_fence_may_be_foreseen() -> None:
    state = at_speed((4.0, 0.0, 0.0), (7.0, 0.0, 5.0))
    inputs = WELL._replace(fence=lambda place: 10.0 - abs(place[0]), state=state)
    assert Conditions().look(inputs, LIMITS, ()) == {}
    assert Condition.FENCE_BREACHED in Conditions().look(inputs, {**LIMITS, "GF_PREDICT": 1}, ())
    assert Condition.FENCE_BREACHED in Conditions().look(inputs, {**LIMITS, "GF_MARGIN": 4.0}, ())
    standing = inputs._replace(standing=True)
    assert Conditions().look(standing, {**LIMITS, "GF_MARGIN": inf}, ()) == {}
