"""The table of sensors that a vehicle may have: one that is added is a row here and a file beside."""

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
"""The place of a row is that of its stream of chance: what is new belongs at the end."""


def is_fitted(row: Instrument, parts: Sensors) -> bool:
    """Whether a vehicle has a sensor."""
    return getattr(parts, row.part) is not None
