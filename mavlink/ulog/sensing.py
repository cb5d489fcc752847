"""Sensor measurements and estimation quality as topics."""

from colibri.common.types import Array
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.telemetry.snapshot import EstimatorState
from colibri.mavlink.ulog import topics
from colibri.mavlink.ulog.blocks import BLOCK_ROWS, Blocks, Turned
from colibri.mavlink.ulog.topics import Records
from colibri.mavlink.wire.ned import frd_from_flu

COLUMNS = (
    *("time_us", "fx", "fy", "fz", "p", "q", "r", "flags", "horizontal_accuracy_m", "vertical_accuracy_m"),
    *("heading_ratio", "velocity_ratio", "position_ratio", "height_ratio", "above_ground_ratio"),
)
"""Time (µs), specific force (m/s², FLU), rates (rad/s, FLU); ESTIMATOR_STATUS_FLAGS; standard deviations of the
position; and the last tests' ratios, rejected above 1.
"""

_turned = Turned(COLUMNS, INERTIAL=(frd_from_flu, "p q r fx fy fz"))


def sensing_numbers(time_us: int, sensed: SensorFrame, estimator: EstimatorState) -> tuple[float, ...]:
    velocity, position, height, heading, above_ground, *_ = estimator.ratios
    return (
        *(time_us, *sensed.specific_force_flu_m_s2, *sensed.rate_flu_rad_s, estimator.flags),
        *(estimator.horizontal_accuracy_m, estimator.vertical_accuracy_m),
        *(heading, velocity, position, height, above_ground),
    )


class SensingBlocks(Blocks):
    def __init__(self) -> None:
        super().__init__(len(COLUMNS))
        self._records = Records(BLOCK_ROWS, topics.SENSORS, topics.ESTIMATOR)

    def encode(self, table: Array) -> bytes:
        count, records = len(table), self._records
        for topic in (topics.SENSORS, topics.ESTIMATOR):
            records[topic, "timestamp"][:count] = table[:, :1]
        records[topics.SENSORS, "gyro_rad"][:count] = _turned(table)
        records[topics.ESTIMATOR, "pos_horiz_accuracy"][:count] = table[:, 8:]
        records[topics.ESTIMATOR, "solution_status_flags"][:count] = table[:, 7:8]
        return records.first(count)
