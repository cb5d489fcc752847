"""What a motion asks for: thrust and tilt with drag as the control laws have it, and the charge it takes."""

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.vehicle_model.airframe import airframe_of, drag_force
from colibri.autopilot.guidance.trajectories.reach import Derivatives, Reach
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")


def motion(
    velocity: tuple[float, float, float], acceleration: tuple[float, float, float], samples: int = 1
) -> Derivatives:
    rows = [np.tile(np.array(row), (samples, 1)) for row in (velocity, acceleration, (0.0,) * 3, (0.0,) * 3)]
    return Derivatives(*rows)


@pytest.mark.parametrize(
    ("velocity", "acceleration"),
    [((3.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((20.0, 5.0, 1.0), (-12.0, 3.0, 2.0)), ((2.0, -14.0, -6.0), (9.0, 5.0, 6.0))],
)
def test_exact_drag_is_that_of_the_control_laws(
    velocity: tuple[float, float, float], acceleration: tuple[float, float, float]
) -> None:
    """T z = m (a + g) - drag(v, z, T), with z tilted about the axis that the force has."""
    reach, airframe = Reach(VEHICLE, load_profile("flight"), exact_drag=True), airframe_of(VEHICLE)
    thrust, _, tilt, *_ = reach.demands(motion(velocity, acceleration), 0.0)
    thrust_n, drag = 4.0 * float(thrust.values[0]), np.zeros(3)
    needed = airframe.mass_kg * (np.array(acceleration) + np.array([0.0, 0.0, airframe.gravity_m_s2]))
    for _ in range(50):
        up = (needed - drag) / np.sqrt(((needed - drag) ** 2).sum())
        drag = np.array(drag_force(airframe, velocity, up, thrust_n))
    force = needed - drag
    assert thrust_n == pytest.approx(np.sqrt((force * force).sum()), rel=2e-3)
    assert float(tilt.values[0]) == pytest.approx(np.degrees(np.arctan2(np.hypot(*force[:2]), force[2])), abs=0.1)


def test_a_hover_takes_what_a_hover_takes() -> None:
    reach = Reach(VEHICLE, load_profile("flight"))
    still = motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1000)
    assert reach.charge_of(still) == pytest.approx(reach.charge_of_hover(10.0), rel=5e-3)
    assert reach.charge_of(still._replace(acceleration=still.acceleration + 5.0)) > 1.4 * reach.charge_of_hover(10.0)
