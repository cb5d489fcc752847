from math import inf

import numpy as np
import pytest

from colibri.autopilot.estimation.eskf_predict import ERRORS, NOMINAL
from colibri.autopilot.estimation.measurements.rangefinder import fuse_distance
from colibri.common.rotations import quaternion_from_euler
from colibri.mavlink.hil.sensors import Distance, SensorFrame, decode_sensors, encode_sensors
from colibri.mavlink.wire.dialect import Codec

BEAM = np.array([np.cos(0.05), np.sin(0.05)])


def distance(height_m: float, roll: float, pitch: float) -> float:
    x, P, y = np.zeros(NOMINAL), np.eye(ERRORS), np.zeros(1)
    x[6:10] = quaternion_from_euler(roll, pitch, 0.3)
    fuse_distance(x, P, 0.0, height_m, BEAM, 1.0, -1.0, y)
    return -float(y[0])


def test_of_a_tilt_within_the_beam_it_is_the_height() -> None:
    assert distance(2.0, 0.03, 0.0) == pytest.approx(2.0, abs=1e-12)


def test_beyond_the_beam_the_nearest_of_it_is_seen() -> None:
    assert distance(2.0, 0.0, 0.35) == pytest.approx(2.0 / np.cos(0.3))


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.4, 0.0), (0.0, -0.3), (0.25, 0.35)])
def test_a_correction_is_along_the_gradient(roll: float, pitch: float) -> None:
    """With P = I a small innovation moves the state along Hᵀ: the distance then fits to first order."""
    x, P, y = np.zeros(NOMINAL), np.eye(ERRORS), np.zeros(1)
    x[6:10] = quaternion_from_euler(roll, pitch, 0.3)
    before = distance(2.0, roll, pitch)
    fuse_distance(x, P, before + 1e-4, 2.0, BEAM, 1e-9, inf, y)
    after, z = np.zeros(1), x.copy()
    fuse_distance(z, np.eye(ERRORS), before + 1e-4, 2.0 + x[2], BEAM, 1.0, -1.0, after)
    assert abs(after[0]) < 1e-7


@pytest.mark.parametrize("distance_m", [0.05, 2.13, inf])
def test_it_goes_over_the_wire(distance_m: float) -> None:
    zero, codec = (0.0, 0.0, 0.0), Codec(1, 1)
    told = Distance(distance_m, 0.05, 40.0, 0.0)
    frame = SensorFrame(1_000_000, 0x3F, zero, zero, zero, 1e5, 15.0, distance=told)
    messages = codec.decode(b"".join(encode_sensors(codec, frame)))
    assert [message.name for message in messages] == ["HIL_SENSOR", "DISTANCE_SENSOR"]
    assert decode_sensors(*messages).distance == pytest.approx(told)
