import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.companion.stack import ARDUPILOT, COLIBRI, PX4, MiddleHovers, ThrustCurve, recognised
from colibri.mavlink.wire.dialect import mav


def test_a_stack_is_recognised() -> None:
    assert recognised(mav.MAV_AUTOPILOT_PX4, b"Colibri\0\0") is COLIBRI
    assert recognised(mav.MAV_AUTOPILOT_GENERIC, b"Colibri\0\0") is COLIBRI
    assert recognised(mav.MAV_AUTOPILOT_PX4, bytes(18)) is PX4
    assert recognised(mav.MAV_AUTOPILOT_ARDUPILOTMEGA, bytes(18)) is ARDUPILOT
    assert recognised(mav.MAV_AUTOPILOT_GENERIC, bytes(18)) is None


@given(
    hover=st.floats(0.2, 0.6),
    expo=st.floats(0.0, 0.9),
    spin_min=st.floats(0.0, 0.2),
    quadratic=st.booleans(),
    load=st.floats(0.3, 1.4),
)
def test_a_thrust_curve_is_its_own_inverse(
    hover: float, expo: float, spin_min: float, quadratic: bool, load: float
) -> None:
    curve = ThrustCurve(hover=hover, expo=expo, spin_min=spin_min, quadratic=quadratic)
    assert curve.command(1.0) == pytest.approx(hover)
    command = curve.command(load)
    if 0.0 < command < 1.0:
        assert curve.load(command) == pytest.approx(load)
    assert MiddleHovers(max_load=2.5).load(MiddleHovers(max_load=2.5).command(load)) == pytest.approx(load)
