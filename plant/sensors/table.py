"""Table of the sensors that a vehicle may have; a new one is a row here and a file beside it."""

from colibri.plant.sensors import barometer, gps, inertial, magnetometer, rangefinder
from colibri.plant.sensors.instrument import Instrument
from colibri.plant.vehicle.sensors import Sensors

ROWS: tuple[Instrument, ...] = (
    inertial.ACCELEROMETER_ROW,
    inertial.GYROSCOPE_ROW,
    magnetometer.ROW,
    barometer.ROW,
    gps.ROW,
    rangefinder.ROW,
)
"""The position of a row selects its random stream: append new rows."""


def is_fitted(row: Instrument, parts: Sensors) -> bool:
    return getattr(parts, row.part) is not None
