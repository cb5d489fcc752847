"""The sensors of a vehicle, as tables of the vehicle file.

Noise (white), drift (first-order Gauss-Markov) and turn-on bias are standard deviations along each axis; densities and
walks are per root hertz. Values beyond a range are clipped; a rangefinder does not see beyond its own.
"""

from typing import Annotated

import msgspec

from colibri.common.config import NotNegative, Positive, Table


class SensorPart(Table, frozen=True, kw_only=True):
    """A part that can be bought."""

    part: str
    """Maker and product."""


class Accelerometer(SensorPart, frozen=True, kw_only=True):
    """Measures specific force along the FLU axes, at every frame."""

    noise_density_m_s2_rthz: NotNegative
    bias_walk_m_s3_rthz: NotNegative
    turn_on_bias_m_s2: NotNegative
    range_m_s2: Positive


class Gyroscope(SensorPart, frozen=True, kw_only=True):
    """Measures rates about the FLU axes, at every frame."""

    noise_density_rad_s_rthz: NotNegative
    bias_walk_rad_s2_rthz: NotNegative
    turn_on_bias_rad_s: NotNegative
    range_rad_s: Positive


class Magnetometer(SensorPart, frozen=True, kw_only=True):
    """Measures the magnetic field along the FLU axes."""

    rate_hz: Positive
    noise_gauss: NotNegative
    hard_iron_gauss: NotNegative
    """Standard deviation, along each axis, of the vehicle's magnetic field after calibration."""


class Barometer(SensorPart, frozen=True, kw_only=True):
    """Measures static pressure."""

    rate_hz: Positive
    noise_pa: NotNegative
    drift_pa: NotNegative
    """Of sensor and weather together."""
    drift_time_s: Positive


class Gps(SensorPart, frozen=True, kw_only=True):
    """Measures position, with noise and drift, and velocity, with noise, both delayed."""

    rate_hz: Positive
    delay_s: NotNegative
    """Time from measurement to transmission, s."""
    fix_type: Annotated[int, msgspec.Meta(ge=3, le=6)]
    """Value of GPS_FIX_TYPE: 3 for a 3D fix, 6 for RTK fixed."""
    horizontal_noise_m: NotNegative
    vertical_noise_m: NotNegative
    horizontal_drift_m: NotNegative
    vertical_drift_m: NotNegative
    drift_time_s: Positive
    velocity_noise_m_s: NotNegative
    satellites: Annotated[int, msgspec.Meta(ge=4, le=64)]


class Rangefinder(SensorPart, frozen=True, kw_only=True):
    """Measures the distance to the ground along the vehicle's own axis, downward."""

    rate_hz: Positive
    min_m: NotNegative
    max_m: Positive
    noise_m: NotNegative
    """Standard deviation at short distance."""
    noise_part: NotNegative
    """Standard deviation in parts of the distance; the variances are added."""
    field_of_view_rad: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
    """Angle of the beam's cone; the nearest surface in it is measured."""
    height_m: Positive
    """Height of the sensor above the ground while the vehicle stands on its feet."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.min_m >= self.max_m:
            raise ValueError("min_m: must lie below max_m")


class Sensors(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The sensors; the rangefinder is optional."""

    accelerometer: Accelerometer
    gyroscope: Gyroscope
    magnetometer: Magnetometer
    barometer: Barometer
    gps: Gps
    rangefinder: Rangefinder | None = None
