"""The estimator over recordings of sensors."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.estimator import Estimator
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.vehicle.description import load_vehicle
from colibri.plant.vehicle.sensors import Sensors
from tests.support import sensor_source as source
from tests.support.sensor_source import GRAVITY_M_S2, INTERVAL_US, Faults, Recording

Change = Callable[[SensorFrame, float], SensorFrame]


def parts() -> Sensors:
    sensors = load_vehicle("hummingbird").sensors
    assert sensors is not None
    return sensors


def estimator() -> Estimator:
    return Estimator(parts(), GRAVITY_M_S2, DEFAULT_ORIGIN, INTERVAL_US)


@lru_cache(maxsize=4)
def recorded(path: source.Path, seed: int, duration_s: float, faults: Faults | None = None) -> Recording:
    return source.record(path, parts(), seed, duration_s, faults)


def estimates(frames: Sequence[SensorFrame], change: Change | None = None) -> list[Estimate | None]:
    seeing = estimator()
    return [seeing.step(change(frame, frame.time_us * 1e-6) if change else frame) for frame in frames]


def known(all_of_them: list[Estimate | None]) -> list[Estimate]:
    return [one for one in all_of_them if one is not None]


def at(of: list[Estimate | None], at_s: float) -> Estimate:
    one = of[round(at_s * 1e6 / INTERVAL_US)]
    assert one is not None
    return one


def last(of: list[Estimate | None]) -> Estimate:
    assert of[-1] is not None
    return of[-1]


def error_m(flight: Recording, of: list[Estimate | None], at_s: float) -> float:
    position = flight.motion.position[round(at_s * 1e6 / INTERVAL_US)]
    return float(np.linalg.norm(position - at(of, at_s).frame.position_enu_m))
