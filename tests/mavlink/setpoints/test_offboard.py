from math import cos, degrees, isfinite, isnan, nan, pi, radians, sin
from typing import Any

import pytest
from hypothesis import given

from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.common.rotations import earth_from_body, euler_from_quaternion, quaternion_from_euler
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.setpoints.offboard import Offboard
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, OffboardSetpoint, PositionSetpoint, turned
from colibri.mavlink.telemetry.snapshot import HomePosition
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu
from tests.support.streamed import FIRST, SECOND, message, messages

INF = float("inf")
LOCAL, GLOBAL, ATTITUDE = "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"
ORIGIN = Geodetic(47.0, 8.0, 400.0)
HOME = HomePosition((3.0, 4.0, 2.0), 0.0)
PLACE = (10.0, 20.0, 5.0)
HEADING = radians(150.0)
ALL = {"x": 1.0, "y": 2.0, "z": -3.0, "vx": 4.0, "vy": 5.0, "vz": -6.0, "afx": 7.0, "afy": 8.0, "afz": -9.0}
POSITION, VELOCITY, ACCELERATION, YAW, RATE = 0x9F8 | 0x400, 0x9C7 | 0x400, 0xC3F, 0xBFF, 0x7FF
"""Masks that leave one group."""


@pytest.fixture
def offboard() -> Offboard:
    service = Offboard()
    service.update(PLACE, HEADING, ORIGIN, HOME)
    return service


def taken(service: Offboard, name: str, **fields: Any) -> OffboardSetpoint | None:
    dropped = service.dropped.total()
    assert list(service.receive(message(name, **fields), FIRST, 1_000)) == []
    setpoint = service.latest(1_000, 0)
    assert (setpoint is None) == (service.dropped.total() > dropped)
    return setpoint


def local(service: Offboard, frame: int, mask: int, **fields: float) -> PositionSetpoint:
    setpoint = taken(service, LOCAL, coordinate_frame=frame, type_mask=mask, **fields)
    assert isinstance(setpoint, PositionSetpoint)
    return setpoint


def approximately(*values: float) -> Any:
    return pytest.approx(values, abs=1e-5, nan_ok=True)


NO = (nan, nan, nan)


@pytest.mark.parametrize(
    ("mask", "position", "velocity", "acceleration", "yaw", "rate"),
    [
        (0x000, (2, 1, 3), (5, 4, 6), (8, 7, 9), pi / 2 - 0.3, -0.1),
        (0xDE3, (nan, nan, 3), (5, 4, nan), NO, nan, nan),
        (0xF000 | 0x9F8, (2, 1, 3), NO, NO, pi / 2 - 0.3, nan),
    ],
)
def test_masks_in_the_local_frame(
    offboard: Offboard, mask: int, position: Any, velocity: Any, acceleration: Any, yaw: float, rate: float
) -> None:
    setpoint = local(offboard, mav.MAV_FRAME_LOCAL_NED, mask, **ALL, yaw=0.3, yaw_rate=0.1)
    assert setpoint.position_enu_m == approximately(*position)
    assert setpoint.velocity_m_s == approximately(*velocity)
    assert setpoint.acceleration_m_s2 == approximately(*acceleration)
    assert (setpoint.yaw_rad, setpoint.yaw_rate_rad_s) == approximately(yaw, rate)
    assert not setpoint.body
    assert setpoint.time_us == 1_000


def test_every_mask_leaves_what_it_leaves() -> None:
    for mask in range(0x1000):
        service = Offboard()
        setpoint = taken(service, LOCAL, coordinate_frame=1, type_mask=mask, **ALL, yaw=0.3, yaw_rate=0.1)
        if mask & 0x200 and mask & 0x1C0 != 0x1C0:
            assert service.dropped == {"force": 1}
        elif mask & 0xDFF == 0xDFF:
            assert service.dropped == {"empty": 1}
        else:
            assert isinstance(setpoint, PositionSetpoint)
            fields = [vector[axis] for vector in setpoint[:3] for axis in (1, 0, 2)]
            fields += [0.0, setpoint.yaw_rad, setpoint.yaw_rate_rad_s]
            assert all(isnan(field) == bool(mask >> bit & 1) for bit, field in enumerate(fields) if bit != 9)


AHEAD = (cos(HEADING), sin(HEADING))
RIGHT = (sin(HEADING), -cos(HEADING))


def beside(base: tuple[float, float], ahead: float, right: float) -> tuple[float, float]:
    return (base[0] + ahead * AHEAD[0] + right * RIGHT[0], base[1] + ahead * AHEAD[1] + right * RIGHT[1])


@pytest.mark.parametrize(
    ("frame", "position"),
    [
        (mav.MAV_FRAME_LOCAL_NED, (2.0, 1.0, 3.0)),
        (mav.MAV_FRAME_LOCAL_OFFSET_NED, (12.0, 21.0, 8.0)),
        (mav.MAV_FRAME_BODY_NED, (2.0, 1.0, 3.0)),
        (mav.MAV_FRAME_BODY_OFFSET_NED, (*beside(PLACE[:2], 1.0, 2.0), 8.0)),
        (mav.MAV_FRAME_BODY_FRD, (*beside(PLACE[:2], 1.0, 2.0), 8.0)),
        (mav.MAV_FRAME_LOCAL_FRD, (*beside((0.0, 0.0), 1.0, 2.0), 3.0)),
        (mav.MAV_FRAME_LOCAL_FLU, (*beside((0.0, 0.0), 1.0, -2.0), -3.0)),
    ],
)
def test_positions_of_local_frames(offboard: Offboard, frame: int, position: tuple[float, float, float]) -> None:
    assert local(offboard, frame, POSITION, **ALL).position_enu_m == approximately(*position)


@pytest.mark.parametrize("frame", [8, 9, 12, 20])
def test_body_velocity_turns_with_the_vehicle(offboard: Offboard, frame: int) -> None:
    setpoint = local(offboard, frame, 0x5C7, vx=4.0, vy=5.0, vz=-6.0, yaw_rate=0.5)
    assert setpoint.body
    assert setpoint.velocity_m_s == approximately(4.0, -5.0, 6.0)
    assert setpoint.yaw_rate_rad_s == -0.5
    for heading in (HEADING, HEADING + 1.0):
        there = setpoint.in_enu(heading)
        assert not there.body
        assert there.velocity_m_s == approximately(
            *earth_from_body(quaternion_from_euler(0.0, 0.0, heading), (4.0, -5.0, 6.0))
        )
    assert setpoint.position_enu_m == approximately(*NO)


def test_a_body_frame_that_is_flu(offboard: Offboard) -> None:
    setpoint = local(offboard, mav.MAV_FRAME_LOCAL_FLU, 0x007, **ALL, yaw=0.3, yaw_rate=0.5)
    assert setpoint.velocity_m_s == (4.0, 5.0, -6.0)
    assert setpoint.acceleration_m_s2 == (7.0, 8.0, -9.0)
    assert setpoint.yaw_rad == pytest.approx(HEADING + 0.3)
    assert setpoint.yaw_rate_rad_s == 0.5


def test_yaw_counts_from_north_or_from_the_heading(offboard: Offboard) -> None:
    for frame in (1, 7, 8):
        assert local(offboard, frame, YAW, yaw=0.3).yaw_rad == pytest.approx(pi / 2 - 0.3)
    for frame in (9, 12, 20):
        assert local(offboard, frame, YAW, yaw=0.3).yaw_rad == pytest.approx(HEADING - 0.3)


def test_half_of_a_body_group(offboard: Offboard) -> None:
    """Right is masked: no speed there, and the place where the vehicle is; up is masked and stays so."""
    setpoint = local(offboard, mav.MAV_FRAME_BODY_FRD, 0xFC0 | 0b110110, x=3.0, vx=2.0)
    assert setpoint.velocity_m_s == approximately(2.0, 0.0, nan)
    assert setpoint.position_enu_m == approximately(*beside(PLACE[:2], 3.0, 0.0), nan)
    fixed = local(offboard, mav.MAV_FRAME_LOCAL_FRD, 0xFF8 | 0b101, y=-7.0)
    ahead = PLACE[0] * AHEAD[0] + PLACE[1] * AHEAD[1]
    assert fixed.position_enu_m == approximately(*beside((0.0, 0.0), ahead, -7.0), nan)


@pytest.mark.parametrize(("frame", "up"), [(0, 50.0), (5, 50.0), (3, 452.0), (6, 452.0), (10, 452.0), (11, 452.0)])
def test_global_frames(offboard: Offboard, frame: int, up: float) -> None:
    there = geodetic_of((100.0, -50.0, 0.0), ORIGIN)
    wire = {"lat_int": round(there.latitude_deg * 1e7), "lon_int": round(there.longitude_deg * 1e7), "alt": 450.0}
    setpoint = taken(offboard, GLOBAL, coordinate_frame=frame, type_mask=0x9F8, **wire, yaw=0.3)
    assert isinstance(setpoint, PositionSetpoint)
    assert setpoint.position_enu_m == pytest.approx((100.0, -50.0, up), abs=0.02)
    assert setpoint.yaw_rad == pytest.approx(pi / 2 - 0.3)
    only_east = taken(offboard, GLOBAL, coordinate_frame=frame, type_mask=0xFFD, lon_int=wire["lon_int"])
    assert isinstance(only_east, PositionSetpoint)
    assert only_east.position_enu_m == pytest.approx((100.0, nan, nan), abs=0.02, nan_ok=True)
    moving = taken(offboard, GLOBAL, coordinate_frame=frame, type_mask=0xDC7, lat_int=2**31 - 1, vx=1.0, vz=2.0)
    assert isinstance(moving, PositionSetpoint)
    assert moving.velocity_m_s == (0.0, 1.0, -2.0)


def test_without_home_nothing_is_relative_to_it(offboard: Offboard) -> None:
    offboard.update(PLACE, HEADING, ORIGIN, None)
    wire = {"lat_int": 470000000, "lon_int": 80000000, "alt": 410.0, "type_mask": 0x9F8}
    assert taken(offboard, GLOBAL, coordinate_frame=6, **wire) is None
    assert offboard.dropped == {"no home": 1}
    assert taken(offboard, GLOBAL, coordinate_frame=5, **wire) is not None


def test_refusals_are_told_every_five_seconds() -> None:
    service, bad = Offboard(StatusText()), message(LOCAL, coordinate_frame=1, type_mask=VELOCITY, vx=80.0)
    told = [len(list(service.receive(bad, FIRST, 20_000 * frame))) for frame in range(500)]
    assert [frame for frame, sends in enumerate(told) if sends] == [0, 250]
    text, *_ = service.receive(bad, FIRST, 10_000_000)
    assert text.fields[1].startswith(b"SET_POSITION_TARGET_LOCAL_NED refused: velocity")


def attitude(service: Offboard, mask: int, **fields: Any) -> AttitudeSetpoint:
    setpoint = taken(service, ATTITUDE, type_mask=mask, **fields)
    assert isinstance(setpoint, AttitudeSetpoint)
    return setpoint


def test_an_attitude_with_thrust(offboard: Offboard) -> None:
    """MAVSDK's mask 7: roll right 30, pitch up 10, yaw 80 from north."""
    wire = ned_frd_from_enu_flu(quaternion_from_euler(radians(30), radians(-10), radians(10)))
    setpoint = attitude(offboard, 7, q=wire, thrust=0.7, body_roll_rate=nan)
    assert setpoint.attitude is not None
    assert [degrees(angle) for angle in euler_from_quaternion(setpoint.attitude)] == pytest.approx([30, -10, 10])
    assert sum(c * c for c in setpoint.attitude) == pytest.approx(1.0, abs=1e-12)
    assert setpoint.thrust == pytest.approx(0.7)
    assert setpoint.rate_flu_rad_s == approximately(*NO)


def test_body_rates_with_thrust(offboard: Offboard) -> None:
    rates = {"body_roll_rate": 0.1, "body_pitch_rate": 0.2, "body_yaw_rate": 0.3}
    setpoint = attitude(offboard, 0x80, **rates, thrust=0.5, q=[nan] * 4)
    assert setpoint.attitude is None
    assert setpoint.rate_flu_rad_s == approximately(0.1, -0.2, -0.3)
    assert attitude(offboard, 0x82, **rates).rate_flu_rad_s == approximately(0.1, nan, -0.3)
    assert isnan(attitude(offboard, 0xC0, **rates, thrust=nan).thrust)


@pytest.mark.parametrize(
    ("fields", "position", "velocity"),
    [
        ({"x": nan, "y": nan, "z": -8.0, "vx": 2.0, "vz": nan}, (nan, nan, 8.0), (0.0, 2.0, nan)),
        ({"x": 1.0, "y": 2.0, "z": nan, "vx": nan, "vy": nan, "vz": nan}, (2.0, 1.0, nan), NO),
    ],
)
def test_nan_masks_axes_as_in_px4(offboard: Offboard, fields: dict[str, float], position: Any, velocity: Any) -> None:
    setpoint = local(offboard, 1, 0xDC0, **fields)
    assert setpoint.position_enu_m == approximately(*position)
    assert setpoint.velocity_m_s == approximately(*velocity)


@pytest.mark.parametrize(
    ("name", "fields", "reason"),
    [
        (LOCAL, {"coordinate_frame": 2, "type_mask": 0x9F8}, "not local"),
        (LOCAL, {"coordinate_frame": 255, "type_mask": 0x9F8}, "not local"),
        (GLOBAL, {"coordinate_frame": 1, "type_mask": 0x9F8}, "not global"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": 0x200 | ACCELERATION}, "force"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": 0xFFF}, "empty"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": POSITION, "x": nan, "y": nan, "z": nan}, "empty"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": POSITION, "x": nan}, "not finite"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": VELOCITY, "vz": INF}, "not finite"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": 0x9F8, "yaw": INF}, "not finite"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": VELOCITY, "vx": 40.0, "vy": -40.0}, "out of range"),
        (LOCAL, {"coordinate_frame": 8, "type_mask": ACCELERATION, "afz": 51.0}, "out of range"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": POSITION, "z": -1.1e6}, "out of range"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": POSITION, "z": 11.0}, "out of range"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": YAW, "yaw": 1e30}, "out of range"),
        (LOCAL, {"coordinate_frame": 1, "type_mask": RATE, "yaw_rate": -100.0}, "out of range"),
        (GLOBAL, {"coordinate_frame": 5, "type_mask": POSITION, "lat_int": 2**31 - 1}, "out of range"),
        (GLOBAL, {"coordinate_frame": 5, "type_mask": POSITION, "lat_int": 0, "lon_int": 0}, "out of range"),
        (GLOBAL, {"coordinate_frame": 5, "type_mask": 0xFFB, "alt": -INF}, "not finite"),
        (ATTITUDE, {"type_mask": 7, "q": [0.0] * 4}, "not a unit quaternion"),
        (ATTITUDE, {"type_mask": 7, "q": [1.0, 0.2, 0.0, 0.0]}, "not a unit quaternion"),
        (ATTITUDE, {"type_mask": 7, "q": [1.0, nan, 0.0, 0.0]}, "not finite"),
        (ATTITUDE, {"type_mask": 7, "q": [1.0, 0.0, 0.0, 0.0], "thrust": 1.1}, "out of range"),
        (ATTITUDE, {"type_mask": 7, "q": [1.0, 0.0, 0.0, 0.0], "thrust": -0.1}, "out of range"),
        (ATTITUDE, {"type_mask": 7, "q": [1.0, 0.0, 0.0, 0.0], "thrust": nan}, "not finite"),
        (ATTITUDE, {"type_mask": 0x80, "body_roll_rate": 40.0}, "out of range"),
        (ATTITUDE, {"type_mask": 0x80, "body_roll_rate": nan}, "not finite"),
        (ATTITUDE, {"type_mask": 0x87, "thrust": 0.5}, "empty"),
    ],
)
def test_what_cannot_be_flown_is_dropped_and_keeps_nothing_alive(
    offboard: Offboard, name: str, fields: dict[str, Any], reason: str
) -> None:
    good = message(LOCAL, coordinate_frame=1, type_mask=POSITION)
    offboard.receive(good, FIRST, 0)
    offboard.receive(message(name, **fields), FIRST, 400_000)
    assert offboard.dropped == {reason: 1}
    assert offboard.refusal(500_000).startswith(f"{name} refused: ")
    assert offboard.refusal(500_000).endswith(f": {reason}")
    assert offboard.refusal(2_000_000) == ""
    assert offboard.latest(400_000, 300_000) is None
    before = offboard.latest(400_000, 400_000)
    assert isinstance(before, PositionSetpoint)
    assert before.time_us == 0


def test_a_group_of_nan_counts_as_masked(offboard: Offboard) -> None:
    setpoint = local(offboard, 1, 0, x=nan, y=nan, z=nan, vx=1.0, yaw=nan, yaw_rate=nan)
    assert setpoint.position_enu_m == approximately(*NO)
    assert setpoint.velocity_m_s == approximately(0.0, 1.0, 0.0)
    assert isnan(setpoint.yaw_rad)
    rest = local(offboard, 1, 0xFF8 | 0b011, x=1.0, y=1.0, z=-2.0)
    assert rest.position_enu_m == approximately(nan, nan, 2.0)


def test_a_setpoint_is_given_until_its_time_out(offboard: Offboard) -> None:
    assert offboard.latest(0, 10**9) is None
    offboard.receive(message(LOCAL, coordinate_frame=1, type_mask=POSITION), FIRST, 1_000_000)
    assert offboard.latest(1_500_000, 500_000) is not None
    assert offboard.latest(1_500_001, 500_000) is None
    assert offboard.latest(999_999, 500_000) is None


def height(setpoint: OffboardSetpoint | None) -> float:
    assert isinstance(setpoint, PositionSetpoint)
    return setpoint.position_enu_m[2]


def stream(service: Offboard, up: float, peer: Any, now_us: int) -> None:
    service.receive(message(LOCAL, coordinate_frame=1, type_mask=POSITION, z=-up), peer, now_us)


def test_the_first_client_is_obeyed_until_it_falls_silent(offboard: Offboard) -> None:
    stream(offboard, 1.0, FIRST, 0)
    stream(offboard, 2.0, SECOND, 100_000)
    assert height(offboard.latest(100_000, 500_000)) == 1.0
    assert offboard.dropped == {"another client": 1}
    stream(offboard, 2.0, SECOND, 500_000)
    assert height(offboard.latest(500_000, 500_000)) == 1.0
    stream(offboard, 3.0, SECOND, 600_000)
    assert height(offboard.latest(600_000, 500_000)) == 3.0
    assert offboard.source == SECOND
    stream(offboard, 1.0, FIRST, 700_000)
    assert height(offboard.latest(700_000, 500_000)) == 3.0


def test_the_client_that_engages_is_obeyed_if_it_streams(offboard: Offboard) -> None:
    stream(offboard, 1.0, FIRST, 0)
    offboard.engage(SECOND, 0)
    assert offboard.source == FIRST
    stream(offboard, 2.0, SECOND, 100_000)
    offboard.engage(SECOND, 200_000)
    assert height(offboard.latest(200_000, 500_000)) == 2.0
    stream(offboard, 1.0, FIRST, 300_000)
    assert height(offboard.latest(300_000, 500_000)) == 2.0


def test_a_crowd_of_clients_takes_no_memory(offboard: Offboard) -> None:
    stream(offboard, 1.0, FIRST, 0)
    for number in range(1000):
        stream(offboard, 2.0, FIRST._replace(channel=100 + number), 0)
    assert len(offboard._received) <= 16  # noqa: SLF001
    assert height(offboard.latest(0, 0)) == 1.0
    late = FIRST._replace(channel=5)
    stream(offboard, 3.0, late, 10_000_000)
    assert height(offboard.latest(10_000_000, 0)) == 3.0


@pytest.mark.parametrize("name", [LOCAL, GLOBAL, ATTITUDE])
def test_whatever_the_fields_hold(name: str) -> None:
    offboard = Offboard()
    offboard.update(PLACE, HEADING, ORIGIN, HOME)
    now_us = 0

    @given(messages(name))
    def check(received: Any) -> None:
        nonlocal now_us
        now_us += 1_000
        assert list(offboard.receive(received, FIRST, now_us)) == []
        setpoint = offboard.latest(now_us, 0)
        if isinstance(setpoint, PositionSetpoint):
            check_position(setpoint)
            check_position(setpoint.in_enu(1.0))
        elif setpoint is not None:
            assert all(isfinite(c) for c in setpoint.attitude or (0.0,))
            assert isnan(setpoint.thrust) or 0.0 <= setpoint.thrust <= 1.0
            assert not any(abs(rate) > 35.0 for rate in setpoint.rate_flu_rad_s)
            assert setpoint.attitude is not None or not all(map(isnan, setpoint.rate_flu_rad_s))

    check()


def check_position(setpoint: PositionSetpoint) -> None:
    numbers = [*setpoint.position_enu_m, *setpoint.velocity_m_s, *setpoint.acceleration_m_s2]
    numbers += [setpoint.yaw_rad, setpoint.yaw_rate_rad_s]
    assert not any(abs(number) > 2.1e6 for number in numbers)
    assert any(isfinite(number) for number in numbers)
    assert not any(abs(number) > 50.001 for number in numbers[3:9])
    assert not abs(setpoint.yaw_rad) > pi + 1e-9


def test_a_turned_velocity_with_one_horizontal_part_has_none() -> None:
    assert turned((nan, nan, 1.0), 1.0)[2] == 1.0
    assert all(isnan(part) for part in turned((nan, 2.0, 1.0), 1.0)[:2])
    assert turned((2.0, 0.0, 1.0), radians(90)) == pytest.approx((0.0, 2.0, 1.0))
