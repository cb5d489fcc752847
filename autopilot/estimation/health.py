"""Health as status texts, arming checks and ESTIMATOR_STATUS."""

from collections.abc import Callable
from functools import lru_cache, partial
from math import hypot
from typing import NamedTuple

from colibri.autopilot.estimation.estimate import Estimate, Health
from colibri.autopilot.estimation.measurements.instrument import Ratio
from colibri.autopilot.estimation.measurements.table import RATIOS, ROWS
from colibri.autopilot.estimation.sensing.rejection import RejectedSource
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.telemetry.snapshot import EstimatorState
from colibri.mavlink.wire.dialect import mav


class _Matter(NamedTuple):
    """A condition of health, with texts for its end and return."""

    well: Callable[[Health], bool]
    ceased: str
    again: str


def _is_valid(source: str, health: Health) -> bool:
    return source not in health.not_accepted


_MATTERS = (
    _Matter(lambda health: health.accel_bias, "accelerometer off: bias reset", "accelerometer accepted again"),
    _Matter(lambda health: health.gyro_bias, "gyroscope off: bias reset", "gyroscope accepted again"),
    *(
        _Matter(partial(_is_valid, row.source), f"{row.source} not accepted", f"{row.source} accepted again")
        for row in ROWS
        if row.source not in tuple(RejectedSource)  # the others have failsafes
    ),
)

_UNKNOWN: tuple[tuple[Callable[[Health], bool], str], ...] = (
    (lambda health: health.gyroscope and health.accelerometer, "inertial sensors failed"),
    (lambda health: health.attitude, "no attitude estimate"),
    (lambda health: health.heading, "no heading estimate"),
    (lambda health: health.horizontal_velocity and health.vertical_velocity, "no velocity estimate"),
    (lambda health: health.horizontal_position and not health.dead_reckoning, "no position estimate"),
    (lambda health: health.height, "no height estimate"),
)

_SENSORS: tuple[tuple[Callable[[Health], bool], int], ...] = (
    (lambda health: health.gyroscope, mav.MAV_SYS_STATUS_SENSOR_3D_GYRO),
    (lambda health: health.accelerometer, mav.MAV_SYS_STATUS_SENSOR_3D_ACCEL),
    *((partial(_is_valid, row.source), row.bit) for row in ROWS),
    (lambda health: health.gps_lost_since_us is None, mav.MAV_SYS_STATUS_SENSOR_GPS),
)

_NO_RATIOS = (0.0,) * len(Ratio)


class HealthWatch:
    def __init__(self) -> None:
        self._ill: frozenset[int] = frozenset()

    def lines(self, health: Health) -> list[tuple[int, str]]:
        ill = frozenset(number for number, matter in enumerate(_MATTERS) if not matter.well(health))
        if ill == self._ill:
            return []
        before, self._ill = self._ill, ill
        ceased = [(WARNING, _MATTERS[number].ceased) for number in sorted(ill - before)]
        return ceased + [(INFO, _MATTERS[number].again) for number in sorted(before - ill)]


def not_known(health: Health) -> str:
    """Return the parts too inaccurate to fly, as text."""
    return ", ".join(reason for known, reason in _UNKNOWN if not known(health))


def estimator_state(estimate: Estimate) -> EstimatorState:
    health, tests = estimate.health, estimate.tests
    east, north, up = estimate.position_std_m
    ratios = [*_NO_RATIOS]
    for kind, test in tests.items():
        ratio = RATIOS[kind]
        ratios[ratio] = max(ratios[ratio], test.ratio)
    return EstimatorState(
        flags=health.flags,
        ratios=tuple(ratios),
        horizontal_accuracy_m=hypot(east, north),
        vertical_accuracy_m=up,
        sensors=_bits(tuple(tests)),
        failed_sensors=_failed(health),
    )


@lru_cache(maxsize=16)  # asked for at every control sample, and hardly ever another, as is what has failed
def _bits(kinds: tuple[str, ...]) -> int:
    return sum(row.bit for row in ROWS if row.name in kinds)


@lru_cache(maxsize=16)
def _failed(health: Health) -> int:
    return sum(bit for well, bit in _SENSORS if not well(health))
