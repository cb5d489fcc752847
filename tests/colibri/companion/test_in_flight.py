"""A companion flies a vehicle of `colibri sitl`, and ends when it must, in memory and in simulated time."""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from math import nan
from typing import Any

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.companion.identification import identified
from colibri.companion.settings import CompanionSettings, SetpointKind
from colibri.companion.stack import COLIBRI
from colibri.companion.supervision.phases import CompanionPhase
from colibri.companion.supervision.rules import FlightLimits
from colibri.flights.snapshots import ObjectSnapshot
from colibri.mavlink.wire.dialect import Codec, Message, mav
from colibri.sitl.backends.setting import Setting
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl
from tests.colibri.companion.in_memory import Ride

MOVES = frozenset({mav.MAV_CMD_DO_SET_MODE, mav.MAV_CMD_COMPONENT_ARM_DISARM, mav.MAV_CMD_NAV_TAKEOFF})
SETPOINTS = ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED")
HOVER = "hover:height=3"
Flying = Callable[[FlightLimits], Ride[Sitl]]


@pytest.fixture
def flights() -> Iterator[Flights]:
    with Flights(Setting(), None) as begun:
        yield begun


@pytest.fixture(scope="module")
def flying() -> Iterator[Flying]:
    """Return a function that flies within limits, from the same instant each time."""

    @cache
    def first(limits: FlightLimits) -> tuple[Ride[Sitl], ObjectSnapshot]:
        ride = in_air(begun, CompanionSettings(limits=limits)).flying(10.0)
        for _ in range(100):
            ride.step()
        return ride, ObjectSnapshot([ride])

    def restored(limits: FlightLimits) -> Ride[Sitl]:
        ride, snapshot = first(limits)
        snapshot.restore()
        return ride

    with Flights(Setting(), None) as begun:
        yield restored


def messages_of(ride: Ride[Sitl], since_us: int = 0) -> list[Message]:
    codec = Codec(0, 0)
    return [message for at_us, frame in ride.sent if at_us >= since_us for message in codec.decode(frame)]


def names_of(ride: Ride[Sitl], since_us: int = 0) -> set[str]:
    return {message.name for message in messages_of(ride, since_us)}


def moves_of(ride: Ride[Sitl], since_us: int = 0) -> list[int]:
    said = (message.fields for message in messages_of(ride, since_us) if message.name == "COMMAND_LONG")
    return [fields.command for fields in said if fields.command in MOVES]


def in_air(flights: Flights, settings: CompanionSettings | None = None) -> Ride[Sitl]:
    return Ride(flights.begin(airborne=3.0), HOVER, settings or CompanionSettings())


def test_it_arms_takes_off_flies_a_track_and_hands_over(flights: Flights) -> None:
    sitl = flights.begin(feedback="sensors", turbulence="light", seed=1)
    ride = Ride(sitl, "spiral", CompanionSettings(may_arm=True, duration_s=3.0))
    assert ride.to_the_end(60.0).in_order
    assert [phase for _, phase in ride.history] == list(CompanionPhase)
    assert ride.companion.errors.rmse_m() < 0.05
    assert ride.companion.errors.flown_s == pytest.approx(3.0, abs=0.1)
    assert sitl.mode is Mode.HOLD
    assert sitl.armed
    setpoints = [at_us for at_us, frame in ride.sent if frame[7:10] == (82).to_bytes(3, "little")]
    gaps_us = {after - before for before, after in pairwise(setpoints)}
    assert gaps_us == {8_000}


def test_a_pilot_s_mode_is_obeyed_at_once_and_never_fought(flights: Flights) -> None:
    ride = in_air(flights).flying(10.0)
    orders_us = ride.now_us
    ride.sitl.gcs.send("COMMAND_LONG", 1, 1, mav.MAV_CMD_DO_SET_MODE, 0, 1.0, 4.0, 5.0, 0.0, 0.0, 0.0, 0.0)
    ride.until(lambda: ride.sitl.mode is Mode.RETURN, 1.0)
    chosen_us = ride.now_us
    assert chosen_us - orders_us < 20_000
    assert ride.to_the_end(1.0).in_order
    assert ride.now_us - chosen_us <= 100_000
    ended_us = ride.now_us
    for _ in range(250):
        ride.step()
    assert ride.sitl.mode is Mode.RETURN
    assert not moves_of(ride, chosen_us)
    assert not names_of(ride, ended_us)


def test_it_never_arms_unless_it_may(flights: Flights) -> None:
    ride = Ride(flights.begin(), HOVER, CompanionSettings(gives_up_s=3.0))
    assert not ride.to_the_end(10.0).in_order
    assert not moves_of(ride)
    assert not names_of(ride) & set(SETPOINTS)
    assert not ride.sitl.armed


def test_a_dry_run_only_asks_and_computes(flights: Flights) -> None:
    ride = in_air(flights, CompanionSettings(dry_run=True, duration_s=2.0))
    assert ride.to_the_end(10.0).in_order
    assert not moves_of(ride)
    assert not names_of(ride) & set(SETPOINTS)
    thrusts = [row.thrust for row in ride.companion.rows]
    assert len(thrusts) > 100
    assert thrusts[-1] == pytest.approx(0.5, abs=0.02)
    assert not any(row.sent for row in ride.companion.rows)


def test_it_waits_for_a_mode_that_stays_by_itself(flights: Flights) -> None:
    ride = in_air(flights)
    with ride.sitl.sticks_held(thrust=0.5):
        ride.sitl.select(Mode.POSITION)
        for _ in range(500):
            ride.step()
        assert ride.companion.phase is CompanionPhase.CHECKING
        assert not names_of(ride) & set(SETPOINTS)


def test_a_vehicle_that_refuses_to_arm_ends_it(flights: Flights) -> None:
    ride = Ride(flights.begin(), HOVER)
    codec = Codec(1, 1)
    ride.until(lambda: ride.companion.phase is CompanionPhase.ARMING, 10.0)
    take_off = mav.MAV_CMD_NAV_TAKEOFF
    ride.companion.receive(codec.encode("COMMAND_ACK", take_off, mav.MAV_RESULT_DENIED), ride.now_us)
    ended = ride.to_the_end(5.0)
    assert not ended.in_order
    assert "take-off was refused" in ended.why


@pytest.mark.long
@pytest.mark.parametrize("kind", [SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ATTITUDE])
def test_it_flies_by_other_setpoints_too(flights: Flights, kind: SetpointKind) -> None:
    sitl = flights.begin(airborne=2.0)
    ride = Ride(sitl, "circle:speed=1", CompanionSettings(setpoints=kind, duration_s=2.0))
    assert ride.to_the_end(30.0).in_order
    assert ride.companion.errors.rmse_m() < 0.3


@pytest.mark.long
def test_an_identification_finds_the_vehicles_response(flights: Flights) -> None:
    ride = in_air(flights, CompanionSettings(identifies=True))
    assert ride.to_the_end(60.0).in_order
    response, text, found = identified(ride.companion)
    assert response.time_constant_s == pytest.approx(COLIBRI.response.time_constant_s, rel=0.15)
    assert response.acceleration_lag_s == pytest.approx(COLIBRI.response.acceleration_lag_s, abs=0.004)
    assert response.latency_s == pytest.approx(COLIBRI.response.latency_s, abs=0.005)
    assert found.explained.min() > 0.9
    assert "time_constant_s" in text


def _say(ride: Ride[Sitl], name: str, *fields: Any) -> Callable[[], None]:
    codec = Codec(1, 1)
    return lambda: ride.companion.receive(codec.encode(name, *fields), ride.now_us)


def _failsafe(ride: Ride[Sitl]) -> Callable[[], None]:
    base = mav.MAV_MODE_FLAG_SAFETY_ARMED | mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return _say(ride, "HEARTBEAT", 2, 12, base, ride.companion.peer.report.mode, mav.MAV_STATE_CRITICAL, 3)


def _jump(ride: Ride[Sitl]) -> Callable[[], None]:
    codec, nothing = Codec(1, 1), (nan,) + (0.0,) * 20

    def step() -> None:
        pose = (9.0, 9.0, -3.0, (1.0, 0.0, 0.0, 0.0), *(0.0,) * 6)
        odometry = codec.encode("ODOMETRY", ride.sitl.time_us + 1, 1, 12, *pose, nothing, nothing, 0, 8, 100)
        ride.companion.receive(odometry, ride.now_us)

    return step


def _blow(ride: Ride[Sitl]) -> None:
    ride.sitl.wind = "14@0"


FENCE = mav.MAV_SYS_STATUS_GEOFENCE
TIGHT_TILT = FlightLimits(max_tilt_deg=12.0, max_error_m=9.0)
TIGHT_ERROR = FlightLimits(max_error_m=0.05, max_tilt_deg=85.0)
TIGHT_BOX = FlightLimits(margin_m=0.03, max_error_m=9.0, max_tilt_deg=85.0)
AS_IT_IS = FlightLimits()


@pytest.mark.parametrize(
    ("name", "provoke", "limits"),
    [
        ("late states", lambda ride: setattr(ride.trouble, "down", True), AS_IT_IS),
        ("estimate lost", lambda ride: _say(ride, "ESTIMATOR_STATUS", 0, 0, *(0.0,) * 8), AS_IT_IS),
        pytest.param("estimate jumped", _jump, AS_IT_IS, marks=pytest.mark.long),
        ("control law", lambda ride: setattr(ride.law, "raises", True), AS_IT_IS),
        ("overloaded", lambda ride: setattr(ride, "polls_every_us", 12_000), AS_IT_IS),
        pytest.param(
            "overloaded", lambda ride: setattr(ride, "polls_every_us", 212_000), AS_IT_IS, marks=pytest.mark.long
        ),
        pytest.param("box", _blow, TIGHT_BOX, marks=pytest.mark.long),
        ("tilt", _blow, TIGHT_TILT),
        pytest.param("error", _blow, TIGHT_ERROR, marks=pytest.mark.long),
        ("battery", lambda ride: _say(ride, "SYS_STATUS", *(0,) * 4, 10_000, -1, 10, *(0,) * 6), AS_IT_IS),
        ("fence", lambda ride: _say(ride, "SYS_STATUS", FENCE, FENCE, 0, 0, 12_000, -1, 90, *(0,) * 6), AS_IT_IS),
        ("failsafe", _failsafe, AS_IT_IS),
    ],
)
def test_each_limit_ends_it_and_leaves_the_vehicle_in_hold(
    flying: Flying, name: str, provoke: Callable[[Ride[Sitl]], Callable[[], None] | None], limits: FlightLimits
) -> None:
    ride = flying(limits)
    goes_on = provoke(ride)
    provoked_us = ride.now_us
    while ride.companion.phase is CompanionPhase.FLYING:
        assert ride.now_us - provoked_us < 3_000_000, name
        if goes_on is not None:
            goes_on()
        ride.step()
    ended_us = ride.now_us
    ride.trouble.down, ride.polls_every_us = False, 0
    assert not ride.to_the_end(5.0).in_order
    limit = ride.companion.limit
    assert limit
    assert limit.name == name
    assert ride.sitl.mode is Mode.HOLD
    if limit.blind:
        assert not names_of(ride, ended_us) & set(SETPOINTS)
    if name == "late states":
        assert 0.1e6 <= ended_us - provoked_us <= 0.12e6
