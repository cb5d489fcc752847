"""Telemetry turns ENU/FLU into NED/FRD: invariants over random attitudes, whatever the convention."""

from math import atan2, cos, degrees, hypot, isclose, pi, sin

import pytest
from hypothesis import assume, given

from colibri.common.rotations import earth_from_body, quaternion_from_euler
from colibri.common.types import Quaternion, Vector
from tests.support.snapshots import FLYING, sent
from tests.support.strategies import ANGLES, quaternions, vectors

NORTH_EAST_DOWN = (0.2152, 0.0124, 0.4312)


@given(quaternions())
def test_euler_angles_and_quaternion_are_of_the_same_attitude(attitude: Quaternion) -> None:
    snapshot = FLYING._replace(attitude=attitude)
    (angles,), (q,) = sent("ATTITUDE", snapshot), sent("ATTITUDE_QUATERNION", snapshot)
    assume(abs(angles.pitch) < 1.55)  # roll and yaw are one and the same when the nose points straight up or down
    again = quaternion_from_euler(angles.roll, angles.pitch, angles.yaw)
    same = abs(sum(a * b for a, b in zip(again, (q.q1, q.q2, q.q3, q.q4), strict=True)))
    assert same == pytest.approx(1.0, abs=1e-3)


@given(ANGLES)
def test_the_nose_points_where_the_heading_says(yaw: float) -> None:
    snapshot = FLYING._replace(attitude=quaternion_from_euler(0.0, 0.0, yaw))
    (position,), (hud,), (angles,) = (sent(name, snapshot) for name in ("GLOBAL_POSITION_INT", "VFR_HUD", "ATTITUDE"))
    east, north, _ = earth_from_body(snapshot.attitude, (1.0, 0.0, 0.0))
    bearing = degrees(atan2(east, north)) % 360.0
    assert 0 <= position.hdg < 36_000
    assert abs((position.hdg / 100 - bearing + 180.0) % 360.0 - 180.0) < 0.01
    assert abs((hud.heading - bearing + 180.0) % 360.0 - 180.0) < 0.51
    assert isclose(cos(angles.yaw), north, abs_tol=1e-6)
    assert isclose(sin(angles.yaw), east, abs_tol=1e-6)


@given(quaternions(), vectors(50.0))
def test_velocity_of_the_body_is_that_of_the_earth_turned(attitude: Quaternion, velocity: Vector) -> None:
    snapshot = FLYING._replace(attitude=attitude, velocity_enu_m_s=velocity)
    (odometry,), (local,) = sent("ODOMETRY", snapshot), sent("LOCAL_POSITION_NED", snapshot)
    turned = earth_from_body(tuple(odometry.q), (odometry.vx, odometry.vy, odometry.vz))
    assert turned == pytest.approx((local.vx, local.vy, local.vz), abs=1e-4)


@given(quaternions(), vectors(20.0))
def test_specific_force_and_field_are_of_the_earth(attitude: Quaternion, acceleration: Vector) -> None:
    snapshot = FLYING._replace(attitude=attitude, acceleration_enu_m_s2=acceleration)
    (imu,), (q,) = sent("HIGHRES_IMU", snapshot), sent("ATTITUDE_QUATERNION", snapshot)
    to_earth = (q.q1, q.q2, q.q3, q.q4)
    east, north, up = acceleration
    force = earth_from_body(to_earth, (imu.xacc, imu.yacc, imu.zacc))
    assert force == pytest.approx((north, east, -up - 9.81), abs=1e-4)
    field = earth_from_body(to_earth, (imu.xmag, imu.ymag, imu.zmag))
    assert field == pytest.approx(NORTH_EAST_DOWN, abs=1e-6)


@given(quaternions())
def test_scaled_and_full_imu_agree(attitude: Quaternion) -> None:
    snapshot = FLYING._replace(attitude=attitude)
    (full,), (scaled,), (raw,) = (sent(name, snapshot) for name in ("HIGHRES_IMU", "SCALED_IMU", "RAW_IMU"))
    assert scaled.zacc == pytest.approx(full.zacc / 9.80665 * 1000.0, abs=0.51)
    assert scaled.xmag == pytest.approx(full.xmag * 1000.0, abs=0.51)
    assert (raw.xacc, raw.zmag) == (scaled.xacc, scaled.zmag)


@given(ANGLES)
def test_course_is_where_the_vehicle_goes(towards: float) -> None:
    snapshot = FLYING._replace(velocity_enu_m_s=(5.0 * cos(towards), 5.0 * sin(towards), 0.0))
    (gps,) = sent("GPS_RAW_INT", snapshot)
    bearing = degrees(pi / 2 - towards) % 360.0
    assert abs((gps.cog / 100 - bearing + 180.0) % 360.0 - 180.0) < 0.01
    assert gps.vel == 500


@given(quaternions())
def test_the_setpoint_has_the_frame_of_the_state(attitude: Quaternion) -> None:
    setpoint = FLYING.setpoint._replace(attitude=attitude)
    (target,) = sent("ATTITUDE_TARGET", FLYING._replace(setpoint=setpoint))
    (state,) = sent("ATTITUDE_QUATERNION", FLYING._replace(attitude=attitude))
    assert tuple(target.q) == (state.q1, state.q2, state.q3, state.q4)


@given(vectors(1000.0))
def test_the_way_to_the_target(target: Vector) -> None:
    (output,) = sent("NAV_CONTROLLER_OUTPUT", FLYING._replace(target_enu_m=target))
    east, north = target[0] - 10.0, target[1] - 20.0
    assert output.wp_dist == pytest.approx(hypot(east, north), abs=0.51)
    if hypot(east, north) > 1e-3:
        bearing = degrees(atan2(east, north))
        assert abs((output.target_bearing - bearing + 180.0) % 360.0 - 180.0) < 0.51
