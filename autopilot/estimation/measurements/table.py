"""The table of fused sensors: a row here, a file beside."""

from colibri.autopilot.estimation.measurements.barometer import BarometerFusion
from colibri.autopilot.estimation.measurements.instrument import FusedInstrument, Ratio
from colibri.autopilot.estimation.measurements.magnetometer import MagnetometerFusion
from colibri.autopilot.estimation.measurements.rangefinder import RangefinderBelow
from colibri.common.types import Vector
from colibri.plant.vehicle.sensors import Sensors

# In the order of fusion within an instant; every vehicle has the first two.
ROWS: tuple[type[FusedInstrument], ...] = (MagnetometerFusion, BarometerFusion, RangefinderBelow)

GPS_KINDS = {"velocity": 3, "position": 2, "height": 1}  # the three measurements of a fix
KINDS: dict[str, int] = {  # numbers in each measurement, in the order of logs
    **GPS_KINDS,
    BarometerFusion.name: BarometerFusion.numbers,
    **{row.name: row.numbers for row in ROWS},
}
RATIOS: dict[str, Ratio] = {
    "velocity": Ratio.VELOCITY,
    "position": Ratio.POSITION,
    "height": Ratio.HEIGHT,
    **{row.name: row.ratio for row in ROWS},
}


def kinds_of(sensors: Sensors) -> list[str]:
    missing = {row.name for row in ROWS if getattr(sensors, row.part) is None}
    return [kind for kind in KINDS if kind not in missing]


def instruments_of(
    sensors: Sensors, field_enu_gauss: Vector
) -> tuple[MagnetometerFusion, BarometerFusion, tuple[FusedInstrument, ...]]:
    field, pressure = MagnetometerFusion(sensors, field_enu_gauss), BarometerFusion(sensors, field_enu_gauss)
    others = [row(sensors, field_enu_gauss) for row in ROWS[2:] if getattr(sensors, row.part) is not None]
    return field, pressure, (field, pressure, *others)
