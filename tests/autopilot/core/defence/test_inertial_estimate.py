"""The state carried on by inertial sensors and barometer alone."""

from math import hypot

import pytest

from colibri.autopilot.core.defence.inertial_estimate import turned
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler, tilt_deg
from colibri.plant.physics.world import state_frame
from colibri.sitl.vehicle import Sitl
from tools.chaos import Thrower


def test_an_attitude_turns_at_its_rates() -> None:
    attitude = quaternion_from_euler(0.1, -0.2, 0.3)
    for _ in range(1000):
        attitude = turned(attitude, (0.0, 0.0, 1.0), 1e-3)
    assert tilt_deg(attitude) == pytest.approx(tilt_deg(quaternion_from_euler(0.1, -0.2, 0.3)), abs=1e-3)
    still = turned(attitude, (0.5, 0.0, 0.0), 0.0)
    assert euler_from_quaternion(still) == pytest.approx(euler_from_quaternion(attitude))


@pytest.mark.sitl(feedback="sensors", strict=False)
def test_the_inertial_estimate_lasts_for_a_landing(sitl: Sitl) -> None:
    sitl.takeoff(5.0)
    thrower = Thrower("autopilot.estimation.estimator:Estimator._take_in")
    thrower.arm()
    try:
        sitl.run(5.5)  # shortly before it touches down
    finally:
        thrower.disarm()
    estimate, truth = sitl.inside.copter.parts.state_source.estimate, state_frame(sitl.inside.world)
    assert estimate is not None
    assert not estimate.health.horizontal_position
    assert sitl.inside.copter.pilot.saving.name == "DESCEND"
    frame = estimate.frame
    (x, y, z), (e, n, u) = frame.velocity_enu_m_s, truth.velocity_enu_m_s
    assert hypot(x - e, y - n) < 0.6
    assert abs(z - u) < 0.4
    assert abs(frame.position_enu_m[2] - truth.position_enu_m[2]) < 1.0
    assert abs(tilt_deg(frame.attitude) - tilt_deg(truth.attitude)) < 2.0
