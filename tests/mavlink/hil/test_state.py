from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil import state
from colibri.mavlink.hil.state import MAX_FRAMES, ActuatorCommand, StateFrame
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec
from tests.support.strategies import quaternions, vectors

FLOAT32_RELATIVE = 1e-6
LEVEL = (1.0, 0.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


def through_the_wire(frame: StateFrame) -> StateFrame | None:
    codec = Codec(1, dialect.PLANT_COMPONENT)
    attitude, position = codec.decode(b"".join(state.encode_state(codec, frame)))
    return state.decode_state(attitude, position)


@given(vectors(), vectors(), quaternions(), vectors(), st.integers(0, 2**32 - 1))
def test_state_round_trip(position: Vector, velocity: Vector, q: Quaternion, rate: Vector, time_ms: int) -> None:
    frame = StateFrame(time_ms * 1000, position, velocity, q, rate)
    decoded = through_the_wire(frame)
    assert decoded is not None
    assert decoded.time_us == frame.time_us
    for name in ("position_enu_m", "velocity_enu_m_s", "attitude", "rate_flu_rad_s"):
        assert getattr(decoded, name) == pytest.approx(getattr(frame, name), rel=FLOAT32_RELATIVE, abs=1e-6)


def test_state_is_ned_and_frd_on_the_wire() -> None:
    codec = Codec(1, dialect.PLANT_COMPONENT)
    frame = StateFrame(0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), LEVEL, (7.0, 8.0, 9.0))
    attitude, position = codec.decode(b"".join(state.encode_state(codec, frame)))
    assert (position.fields.x, position.fields.y, position.fields.z) == (2.0, 1.0, -3.0)
    assert (position.fields.vx, position.fields.vy, position.fields.vz) == (5.0, 4.0, -6.0)
    assert (attitude.fields.rollspeed, attitude.fields.pitchspeed, attitude.fields.yawspeed) == (7.0, -8.0, -9.0)
    facing_east = (attitude.fields.q1, attitude.fields.q2, attitude.fields.q3, attitude.fields.q4)
    assert facing_east == pytest.approx((np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)), abs=1e-7)


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize("field", ["position_enu_m", "velocity_enu_m_s", "rate_flu_rad_s"])
def test_a_state_that_is_not_finite_is_refused(field: str, bad: float) -> None:
    level: Any = StateFrame(0, ZERO, ZERO, LEVEL, ZERO)
    assert through_the_wire(level._replace(**{field: (0.0, bad, 0.0)})) is None


@pytest.mark.parametrize("q", [(nan, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (0.9, 0.0, 0.0, 0.0), (inf, 0.0, 0.0, 0.0)])
def test_an_attitude_that_is_no_rotation_is_refused(q: Quaternion) -> None:
    assert through_the_wire(StateFrame(0, ZERO, ZERO, q, ZERO)) is None


def test_halves_of_different_frames_are_refused() -> None:
    codec = Codec(1, dialect.PLANT_COMPONENT)
    early = StateFrame(0, ZERO, ZERO, LEVEL, ZERO)
    late = StateFrame(1000, ZERO, ZERO, LEVEL, ZERO)
    attitude, _, _, position = codec.decode(
        b"".join(state.encode_state(codec, early) + state.encode_state(codec, late))
    )
    assert state.decode_state(attitude, position) is None


CONTROLS, TIMES = st.floats(0.0, 1.0, width=32), st.integers(0, 2**64 - 1)


@given(st.builds(ActuatorCommand, TIMES, st.tuples(*(CONTROLS,) * 4), st.booleans(), st.integers(1, MAX_FRAMES)))
def test_actuator_round_trip(command: ActuatorCommand) -> None:
    codec = Codec(1, dialect.AUTOPILOT_COMPONENT)
    (message,) = codec.decode(state.encode_actuators(codec, command))
    assert state.decode_actuators(message) == command


@pytest.mark.parametrize("bad", [nan, inf, -inf, -0.001, 1.001, 1e30])
@pytest.mark.parametrize("rotor", range(4))
def test_a_control_that_no_rotor_can_follow_is_refused(rotor: int, bad: float) -> None:
    codec = Codec(1, dialect.AUTOPILOT_COMPONENT)
    controls = [0.5] * 4
    controls[rotor] = bad
    c1, c2, c3, c4 = controls
    (message,) = codec.decode(state.encode_actuators(codec, ActuatorCommand(0, (c1, c2, c3, c4), armed=True)))
    assert state.decode_actuators(message) is None
