"""Rates that jump within one sample: by a bias of the gyroscope, a knock, or, sample after sample, white noise.

The magnetic field tells a bias from a knock: from the last field before the jump, the rates with and without it predict
two fields.
A jump about the direction of the field changes no field: it stays undecided, and the filter finds it.
"""

from math import dist
from typing import TypeAlias

from colibri.common.types import Vector
from colibri.plant.vehicle.sensors import Sensors

Field: TypeAlias = tuple[float, ...]  # x, y, z, gauss

_LEAST_RAD_S = 0.5  # of a jump, summed over the axes; the filter finds smaller biases in time
_BEFORE_PART, _AFTER_PART = 0.25, 0.8  # of the jump: larger changes before it, or after (by the law), end the test
_FITS_PART, _FITS_SIGMAS = 0.02, 5.0  # of the field and of its noise: a prediction with a smaller error fits
_CONTRADICTED = 2.0  # times that: the least error of the other prediction
_WITHIN_S = 0.4
_WILD_RAD_S = 3.0  # least difference between the changes in two samples, summed over the axes
_JUMP_SHAKES = 2  # samples with such a difference at one jump


class RateJump:
    """Watches the rates of one vehicle.

    `samples` counts the samples since the jump, `shakes` those of wild noise, less the calm ones between.
    """

    def __init__(self, sensors: Sensors, field_gauss: float) -> None:
        self._fits_gauss = max(_FITS_PART * field_gauss, _FITS_SIGMAS * sensors.magnetometer.noise_gauss)
        self._field: Field | None = None  # last measured
        self._field_s = 0.0  # its age
        self._change: Vector = (0.0, 0.0, 0.0)  # in the last sample, rad/s
        self._jump: Vector | None = None  # under examination, rad/s
        self._if_turn: Field = self._change  # predicted fields, gauss
        self._if_bias: Field = self._change
        self._left_s = 0.0  # for the decision
        self.samples = self.shakes = 0

    def forget(self) -> None:
        self._jump = self._field = None

    def look(self, before: Vector, rate: Vector, interval_s: float, field: Field | None) -> Vector | None:
        """Take the rates, rad/s, at both ends of a sample and the field, gauss, at its end, FLU; return a bias."""
        (a, b, c), (p, q, r) = before, rate
        last, change = self._change, (p - a, q - b, r - c)
        size, bias = _size(change), None
        examined = _size(self._jump) if self._jump is not None else _LEAST_RAD_S
        self._change = change
        self._field_s += interval_s
        if size > _LEAST_RAD_S and _size(_less(change, last)) > _WILD_RAD_S:
            self.shakes += 1
        elif self.shakes > 0:
            self.shakes -= 1
        if size > examined and _size(last) < _BEFORE_PART * size:
            self._jump, self.samples = _less(change, last), 0
        elif self._jump is not None:
            self.samples += 1
            if self.shakes > _JUMP_SHAKES:
                self._jump = None
            elif self.samples > 1:
                bias = self._follow(self._jump, rate, interval_s, field)
            elif self._field is None or size > _AFTER_PART * examined:
                self._jump = None
            else:
                self._begin(self._field, self._jump, rate, interval_s)
        if field is not None:
            self._field, self._field_s = field, 0.0
        return bias

    def _begin(self, field: Field, jump: Vector, rate: Vector, interval_s: float) -> None:
        """Predict the field after one sample with the jump, and the half of one in which it began."""
        after_s = min(1.5 * interval_s, self._field_s)
        field = _turned(field, _less(rate, jump), self._field_s - after_s)
        self._if_turn, self._if_bias = _turned(field, rate, after_s), _turned(field, _less(rate, jump), after_s)
        self._left_s = _WITHIN_S

    def _follow(self, jump: Vector, rate: Vector, interval_s: float, field: Field | None) -> Vector | None:
        self._if_turn = _turned(self._if_turn, rate, interval_s)
        self._if_bias = _turned(self._if_bias, _less(rate, jump), interval_s)
        self._left_s -= interval_s
        is_turn = is_bias = False
        if field is not None:
            fits_gauss, contradicted_gauss = self._fits_gauss, _CONTRADICTED * self._fits_gauss
            turn_gauss, bias_gauss = dist(field, self._if_turn), dist(field, self._if_bias)
            is_turn = turn_gauss < fits_gauss and bias_gauss > contradicted_gauss
            is_bias = bias_gauss < fits_gauss and turn_gauss > contradicted_gauss
        if is_turn or is_bias or self._left_s < 0.0:
            self._jump = None
        return jump if is_bias else None


def _size(rate: Vector) -> float:
    p, q, r = rate
    return abs(p) + abs(q) + abs(r)


def _less(rate: Vector, other: Vector) -> Vector:
    (p, q, r), (a, b, c) = rate, other
    return (p - a, q - b, r - c)


def _turned(field: Field, rate: Vector, time_s: float) -> Field:
    """Return the components of a fixed vector after a turn of the axes, to second order."""
    (x, y, z), (p, q, r) = field, (rate[0] * time_s, rate[1] * time_s, rate[2] * time_s)
    dx, dy, dz = y * r - z * q, z * p - x * r, x * q - y * p
    return (
        x + dx + 0.5 * (dy * r - dz * q),
        y + dy + 0.5 * (dz * p - dx * r),
        z + dz + 0.5 * (dx * q - dy * p),
    )
