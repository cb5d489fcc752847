"""Whatever fails, the vehicle is handed over, the reason is said, and the exit code is not that of success."""

from collections.abc import Callable
from errno import ENOSPC
from functools import cache
from io import StringIO
from math import cos, hypot, pi, sin
from types import SimpleNamespace
from typing import Any, cast

import pytest

from colibri.common.rotations import tilt_deg
from colibri.common.types import Address
from colibri.companion.process import _Log, _Wire
from colibri.companion.setpoints import FlightSummary
from colibri.companion.settings import CompanionSettings
from colibri.companion.steering.references import Stay, stay_of
from colibri.companion.supervision.phases import CompanionPhase, Consistency, PhaseCondition, how_it_ended
from colibri.companion.supervision.rules import LIMITS
from colibri.companion.vehicle_peer import VehiclePeer
from colibri.flights.snapshots import ObjectSnapshot
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import Codec, mav
from tests.colibri.companion.in_memory import Ride
from tests.colibri.companion.stand_in import PX4_HOLD, REJECTED, Px4, StandIn

HERE = (12.0, -7.0, 6.0)
NORTH_WEST = (cos(0.375 * pi), 0.0, 0.0, sin(0.375 * pi))
PX4_LAND = 4 << 16 | 6 << 24


def hovering(
    settings: CompanionSettings | None = None, track: str = "hover", vehicle: StandIn | None = None
) -> Ride[StandIn]:
    """Return a ride to a vehicle that holds away from the origin, looking north-west."""
    vehicle = vehicle or Px4()
    vehicle.position[:], vehicle.attitude, vehicle.armed = HERE, NORTH_WEST, True
    return Ride(vehicle, track, settings or CompanionSettings(stay=stay_of(track)))


@cache
def began_to_hover() -> tuple[Ride[StandIn], ObjectSnapshot]:
    ride = hovering().flying(8.0)
    return ride, ObjectSnapshot([ride])


def flying() -> Ride[StandIn]:
    """Return the ride that hovers, from the same instant each time."""
    ride, snapshot = began_to_hover()
    snapshot.restore()
    return ride


@pytest.mark.parametrize(
    ("options", "place"), [("", HERE), pytest.param(":height=7", (12.0, -7.0, 7.0), marks=pytest.mark.long)]
)
def test_a_hover_stays_where_the_vehicle_is(options: str, place: tuple[float, ...]) -> None:
    stay = stay_of(f"hover{options}")
    ride = hovering(CompanionSettings(stay=stay, duration_s=2.0), f"hover{options}")
    farthest_m = turned = 0.0
    while ride.companion.ended is None:
        ride.step()
        farthest_m = max(farthest_m, hypot(*(ride.sitl.position[:2] - HERE[:2])))
        turned = max(turned, 1.0 - abs(sum(a * b for a, b in zip(ride.sitl.attitude, NORTH_WEST, strict=True))))
    assert ride.companion.ended.in_order, ride.companion.ended.why
    assert farthest_m < 0.5
    assert turned < 0.01
    assert ride.sitl.position == pytest.approx(place, abs=0.3)


def test_options_of_a_hover_are_those_given() -> None:
    assert stay_of("hover:x=2,yaw=90") == Stay(x=2.0, yaw=90.0)
    assert stay_of("hover") == Stay()
    assert stay_of("spiral") is None


def _raise(ride: Ride[StandIn]) -> None:
    ride.until(lambda: ride.companion.phase is CompanionPhase.CHECKING, 4.0)
    ride.law.raises = True


def _nothing(ride: Ride[StandIn]) -> None:
    del ride


def _discharge(ride: Ride[StandIn]) -> None:
    ride.sitl.charge = 10


@pytest.mark.parametrize(
    ("provoke", "settings", "why"),
    [
        (_nothing, {"duration_s": 1.0}, ""),
        (_raise, {"duration_s": 1.0}, "control law"),
        (_discharge, {"gives_up_s": 5.5}, "battery: 10 % are left"),
        (lambda ride: setattr(ride.trouble, "down", True), {"gives_up_s": 1.0}, "waits for a HEARTBEAT"),
    ],
)
def test_a_dry_run_ends_in_order_only_after_all_checks(
    provoke: Callable[[Ride[StandIn]], None], settings: dict[str, Any], why: str
) -> None:
    ride = hovering(CompanionSettings(dry_run=True, stay=Stay(), **settings))
    provoke(ride)
    ended = ride.to_the_end(80.0 if settings == {"duration_s": 1.0} else 6.0)
    assert ended.in_order is (why == "")
    assert why in ended.why


@pytest.mark.parametrize(("refusals", "mode"), [(2, PX4_HOLD), (9, PX4_LAND)])
def test_hold_is_refused_three_times_before_land(refusals: int, mode: int) -> None:
    class Unwilling(Px4):
        left = refusals

        def _set_mode(self, params: list[float]) -> int:
            if self.mode == self.offboard and params[1:3] == [4.0, 3.0] and self.left > 0:
                self.left -= 1
                return REJECTED
            return super()._set_mode(params)

    ride = hovering(vehicle=Unwilling()).flying(8.0)
    ride.companion.stop("SIGHUP")
    assert ride.to_the_end(9.0).in_order is (mode == PX4_HOLD)
    assert ride.sitl.mode == mode


def test_a_stream_that_another_station_ended_is_requested_again() -> None:
    ride = hovering(CompanionSettings(stay=Stay(), dry_run=True))
    ride.until(lambda: ride.companion.phase is CompanionPhase.CHECKING, 8.0)
    del ride.sitl.streams["SYS_STATUS"]
    ride.until(lambda: any("status report (SYS_STATUS)" in line for line in ride.companion.failing), 4.0)
    ride.until(lambda: not ride.companion.failing, 4.0)


@pytest.mark.parametrize(
    ("why", "limit", "fault", "in_order"),
    [
        (PhaseCondition.PILOT, None, "", True),
        (PhaseCondition.PILOT, LIMITS[0], "", False),
        (PhaseCondition.PILOT, None, "the vehicle reports an emergency", False),
        (PhaseCondition.HELD, None, "", True),
        (PhaseCondition.HELD, None, "companion.csv cannot be written", False),
        (PhaseCondition.TOO_LATE, None, "", False),
    ],
)
def test_a_flight_ends_in_order_without_limit_or_fault(
    why: PhaseCondition, limit: Any, fault: str, in_order: bool
) -> None:
    ended = how_it_ended(CompanionPhase.HANDING_OVER, why, limit, fault, [])
    assert ended.in_order is in_order
    assert ended.why


@pytest.mark.parametrize("stale", ["rate", "attitude", "velocity", "position", ""])
def test_stale_values_contradict_the_others(stale: str) -> None:
    """Turn at 1.5 rad/s and move at 2 m/s; from 0.5 s on one value stays 0 although the vehicle changed its motion."""
    states, since_s = Consistency(), None
    for n in range(200):
        t = 0.01 * n
        moving = 0.0 if t < 0.5 else t - 0.5
        p, v = (1.5, 2.0) if t >= 0.5 else (0.0, 0.0)
        if stale == "rate":
            p = 0.0
        if stale == "velocity":
            v = 0.0
        turned = 0.0 if stale == "attitude" else 1.5 * moving
        x = 0.0 if stale == "position" else 2.0 * moving
        attitude = (cos(0.5 * turned), sin(0.5 * turned), 0.0, 0.0)
        states.add(round(1e6 * t), StateFrame(0, (x, 0.0, 0.0), (v, 0.0, 0.0), attitude, (p, 0.0, 0.0)))
        if states.contradiction and since_s is None:
            since_s = t - 0.5
    assert (since_s is not None) is (stale != "")
    assert since_s is None or since_s <= 0.5


class _FullDisk(StringIO):
    def write(self, text: str) -> int:
        if self.tell() > 0:
            raise OSError(ENOSPC, "No space left on device")
        return super().write(text)


def test_a_log_that_cannot_be_written_hands_the_vehicle_over() -> None:
    ride = flying()
    log = _Log(_FullDisk(), FlightSummary())
    while ride.companion.ended is None:
        ride.step()
        log.write(ride.companion)
    assert not ride.companion.ended.in_order
    assert "companion.csv cannot be written" in ride.companion.ended.why
    assert ride.sitl.mode == PX4_HOLD


def test_another_sender_does_not_take_the_link() -> None:
    beat = Codec(1, 1).encode("HEARTBEAT", 2, mav.MAV_AUTOPILOT_PX4, 0, 0, 4, 3)
    vehicle: Address = ("10.0.0.2", 14580)
    stranger: Address = ("10.0.0.9", 9)
    waiting: list[tuple[bytes, Address]] = []
    sent: list[Address | None] = []
    link = SimpleNamespace(
        target=None,
        receive_now=lambda: [waiting.pop(0) for _ in range(len(waiting))],
        take_opened=list,
        take_closed=list,
        send=lambda _frame, address: sent.append(address),
    )
    wire, peer = _Wire(cast(Any, link)), VehiclePeer()

    def hear(at_s: float, *datagrams: tuple[bytes, Address]) -> Address | None:
        waiting.extend(datagrams)
        for datagram in wire.receive(peer, at_s):
            peer.receive(datagram, round(1e6 * at_s))
        wire.send([b""])
        return sent[-1]

    assert hear(0.0, (beat, vehicle), (b"noise", stranger)) == vehicle
    assert hear(1.0, (beat, stranger), (b"noise", stranger)) == vehicle
    assert wire.take_ignored() == [stranger]
    assert wire.take_ignored() == []
    assert hear(9.0, (b"noise", stranger)) == vehicle
    moved = ("10.0.0.2", 14581)
    assert hear(9.1, (beat, moved)) == moved


@pytest.mark.parametrize(
    ("message", "limit", "within_s"),
    [
        pytest.param("HEARTBEAT", "stale reports", 6.2, marks=pytest.mark.long),
        ("ESTIMATOR_STATUS", "stale reports", 3.5),
        pytest.param("SYS_STATUS", "stale reports", 5.5, marks=pytest.mark.long),
        pytest.param("TIMESYNC", "stale reports", 3.5, marks=pytest.mark.long),
        ("ODOMETRY", "late states", 0.2),
    ],
)
def test_a_report_that_stops_ends_the_flight_at_its_age(message: str, limit: str, within_s: float) -> None:
    ride = flying()
    ride.sitl.silent.add(message)
    ride.until(lambda: ride.companion.phase is not CompanionPhase.FLYING, within_s)
    assert ride.companion.limit is not None
    assert ride.companion.limit.name == limit
    assert message in ride.companion.said[-2] or limit == "late states"


def test_stuck_body_rates_end_the_flight_before_it_leans() -> None:
    ride = flying()
    ride.sitl.frozen_rate = (0.0, 1.5, 0.0)
    leaned = 0.0
    while ride.companion.ended is None:
        ride.step()
        leaned = max(leaned, tilt_deg(ride.sitl.attitude))
    assert ride.companion.limit is not None
    assert leaned < 35.0
    assert hypot(*(ride.sitl.position - HERE)) < 2.0


def test_an_identification_that_is_stopped_is_not_complete() -> None:
    ride = hovering(CompanionSettings(identifies=True)).flying(8.0)
    (order,) = Codec(0, 0).decode(ride.companion.last_order()[0])
    assert (order.name, order.fields.command) == ("COMMAND_LONG", mav.MAV_CMD_DO_SET_MODE)
    ride.companion.stop("SIGINT")
    assert ride.to_the_end(5.0).in_order
    assert not ride.companion.completed
