"""The sensor frames of a flight, fed to an estimator again: the same states."""

import gzip
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from colibri.autopilot.estimation.estimator import Estimator
from colibri.bench.costs import sensor_frames
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.types import Array
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.flight_topics import ESTIMATE
from colibri.mavlink.ulog.inputs import CONTENT_BYTES, InputRecord, decode_inputs
from colibri.mavlink.ulog.reader import FlightFile
from colibri.plant.vehicle.description import load_vehicle
from tools.harness.processes import fly, topic_rows

GOLDEN = Path(__file__).parents[2] / "golden"
FRAME_US, CONTROL_US = 4000, 8000
STATE_COLUMNS = slice(1, 14)


def replayed(inputs: Iterable[InputRecord]) -> dict[int, tuple[float, ...]]:
    vehicle = load_vehicle("hummingbird")
    assert vehicle.sensors is not None
    estimator = Estimator(vehicle.sensors, vehicle.gravity_m_s2, DEFAULT_ORIGIN, FRAME_US)
    states: dict[int, tuple[float, ...]] = {}
    for frame in sensor_frames(inputs):
        estimator.receive(frame)
        estimate = estimator.estimate() if frame.time_us % CONTROL_US == 0 else estimator.last
        if estimate is not None and estimate.frame.time_us == frame.time_us:
            f = estimate.frame
            states[f.time_us] = (*f.position_enu_m, *f.velocity_enu_m_s, *f.attitude, *f.rate_flu_rad_s)
    return states


def chunks(content: bytes) -> Iterator[bytes]:
    """Yield the messages of a capture, each without its head."""
    size = messages.HEAD_BYTES + CONTENT_BYTES
    for begin in range(0, len(content), size):
        yield content[begin + messages.HEAD_BYTES : begin + size]


def logged(path: Path) -> Array:
    table: Array = np.genfromtxt(path, delimiter=",", skip_header=1)
    return table


def test_a_flight_replays_bit_for_bit(tmp_path: Path) -> None:
    fly(tmp_path, "spiral", "--feedback", "sensors", "--seed", "3", "--duration", "8", "--link", "memory")
    again = replayed(FlightFile(tmp_path / "flight.ulg").inputs())
    logged_rows = np.stack(list(topic_rows(tmp_path, ESTIMATE).values()), axis=1)
    assert len(logged_rows) > 500
    for row in logged_rows:
        assert again[round(row[0] * 1e6)] == tuple(row[STATE_COLUMNS])


def test_a_golden_capture_gives_the_same_states_as_ever() -> None:
    """To 1e-9 only: another processor may round the last bits otherwise."""
    with gzip.open(GOLDEN / "spiral-sensors.frames.gz") as capture:
        states = replayed(decode_inputs(chunks(capture.read())))
    for time_s, *state in logged(GOLDEN / "spiral-sensors.csv"):
        assert np.abs(np.array(states[round(time_s * 1e6)]) - state).max() < 1e-9
