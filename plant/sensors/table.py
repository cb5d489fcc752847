"""Table of the sensors that a vehicle may have; a new one is a row here and a file beside it."""

from dataclasses import replace

from colibri.mavlink.hil.faults import ACCELEROMETER, BAROMETER, GPS, GYROSCOPE, MAGNETOMETER, RANGEFINDER
from colibri.mavlink.hil.sensors import Updated
from colibri.plant.sensors import barometer, gps, inertial, magnetometer, rangefinder
from colibri.plant.sensors.instrument import Instrument
from colibri.plant.vehicle.sensors import Sensors

_FORCE, _RATE, _FIELD = "specific_force_flu_m_s2", "rate_flu_rad_s", "magnetic_field_flu_gauss"

ROWS: tuple[Instrument, ...] = (
    Instrument("accelerometer", _FORCE, Updated.ACCELEROMETER, ACCELEROMETER, inertial.accelerometer),
    Instrument("gyroscope", _RATE, Updated.GYROSCOPE, GYROSCOPE, inertial.gyroscope),
    Instrument("magnetometer", _FIELD, Updated.MAGNETOMETER, MAGNETOMETER, magnetometer.switched_on),
    Instrument("barometer", "pressure_pa", Updated.BAROMETER, BAROMETER, barometer.switched_on, barometer.shifted),
    Instrument("gps", "gps", 0, GPS, gps.switched_on, gps.moved, lambda fix, now_us: replace(fix, time_us=now_us)),
    Instrument("rangefinder", "distance", 0, RANGEFINDER, rangefinder.switched_on, rangefinder.shifted),
)
"""The position of a row selects its random stream: append new rows."""


def is_fitted(row: Instrument, parts: Sensors) -> bool:
    return getattr(parts, row.part) is not None
