"""The attitude of a quadrotor on three rotors: it spins, and its thrust axis tracks a direction.

The motion is periodic (M. W. Mueller and R. D'Andrea, ICRA 2014): the vehicle turns about an axis fixed in body and
earth. The opposite rotor's thrust tilts it by the cone angle, and brakes the spin into the gyroscope's range.

The law is an LQR about this motion, scheduled by the spin (LPV), with rotor lag and sampling. Rotors a and b are beside
the lost one, o opposite. State: the demanded thrust direction h in body x and y, rates p and q, and the lagging forces
d = f_b - f_a and f_o.
"""

from math import copysign, hypot, inf, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.parts.riccati import lqr
from colibri.autopilot.errors import AutopilotError
from colibri.common.kernels import atan, exp, log, tan
from colibri.common.matrices import dot, expm, matvec
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_SPINS_RAD_S = np.arange(-8.0, 45.0)  # with gains; positive in the direction of the remaining torque
_NO_CONE_RAD_S, _WHOLE_CONE_RAD_S = 5.0, 15.0  # the cone opens between these: at a slow spin it would take a large tilt
_MAX_CONE_RAD = 0.35
_SCARCE = 0.03  # least weight factor of f_o, where the solution has no thrust to take away
_TIGHTEST = 1e-3
# Tolerated deviations, rad, rad/s of p and q, and parts of a quarter of the weight: the cost weighs with their squares.
_DIRECTION, _RATE, _FORCE_PART = 0.12, 3.0, 0.6
_BISECTIONS = 50
_SAME_SAMPLE = 1e-9
_LEAST_MOMENTUM = 1e-12  # N m s: steady rates have a pole where the gyroscopic moments of body and rotors cancel


class ThreeRotorsError(AutopilotError):
    """A vehicle that cannot land on three rotors, with the reason."""


class Trio(NamedTuple):
    """The three remaining rotors, by number."""

    lost: int
    a: int  # beside the lost one
    b: int  # the other one beside it
    o: int  # opposite
    sign: float  # +1 if their torque spins the vehicle counter-clockwise seen from above, else -1


class SpinSolution(NamedTuple):
    """The periodic solution of a spin."""

    h: Array  # direction of the mean thrust in body x and y, (2,)
    rate: Array  # p and q, rad/s, (2,)
    opposite_n: float


class ReducedAttitude:
    """The law for one vehicle that has lost one rotor."""

    def __init__(self, vehicle: Vehicle, lost: int, interval_s: float, follows: float, spin_rad_s: float) -> None:
        self.trio = trio_without(vehicle, lost)
        allocation = vehicle.allocation()
        a, b, o = (allocation[1:3, rotor] / allocation[0, rotor] for rotor in self.trio[1:4])
        self._per_difference, self._per_opposite = 0.5 * (b - a), o - 0.5 * (a + b)
        self._inertia = vehicle.body.inertia_kg_m2
        self._weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
        opposite_n = balancing_thrust(vehicle, self.trio, spin_rad_s)
        self._momentum = _momentum(vehicle, self.trio, opposite_n)
        rate = self._steady_rate(spin_rad_s * self.trio.sign) * opposite_n
        self.cone_rad = min(atan(hypot(rate[0], rate[1]) / spin_rad_s), _MAX_CONE_RAD)  # at the final spin
        self._gains = self._designed(interval_s, follows)
        if not np.isfinite(self._gains).all():
            raise ThreeRotorsError(f"no law turns it without rotor {lost + 1}")

    def command(self, direction: Array, rate: Array, forces: Array) -> tuple[float, float]:
        """Return the commands of d and f_o, N; `direction` is a unit vector, FLU."""
        spin = float(rate[2]) * self.trio.sign
        solution = self.solution(spin)
        h = direction[:2]
        if direction[2] < 0.0:  # beyond the horizon the error no longer grows with the sine of the angle
            h = h / max(hypot(h[0], h[1]), _TIGHTEST)
        deviation = np.array([*(h - solution.h), *(rate[:2] - solution.rate), forces[0], forces[1]])
        deviation[5] -= solution.opposite_n
        d, f_o = matvec(-self._gain(spin), deviation).tolist()
        return d, f_o + solution.opposite_n

    def solution(self, spin: float) -> SpinSolution:
        """Return the solution of a spin, rad/s, positive along the rotors' torque."""
        opened = (spin - _NO_CONE_RAD_S) / (_WHOLE_CONE_RAD_S - _NO_CONE_RAD_S)
        if opened <= 0.0:
            return SpinSolution(np.zeros(2), np.zeros(2), 0.0)
        tangent = tan(min(opened, 1.0) * self.cone_rad)
        r = spin * self.trio.sign
        per_newton = self._steady_rate(r)
        length = hypot(per_newton[0], per_newton[1])
        if length == 0.0:  # an opposite rotor without an arm opens no cone
            return SpinSolution(np.zeros(2), np.zeros(2), 0.0)
        opposite_n = tangent * spin / length
        rate = per_newton * opposite_n
        return SpinSolution(rate / r / sqrt(1.0 + tangent * tangent), rate, opposite_n)

    def _steady_rate(self, r: float) -> Array:
        """Return p and q for each N of the opposite rotor, with p' = q' = 0 at spin r."""
        ix, iy, iz = self._inertia
        x, y = self._per_opposite
        about = (r * (iz - i) + self._momentum for i in (ix, iy))
        about_x, about_y = (copysign(max(abs(each), _LEAST_MOMENTUM), each) for each in about)
        return np.array([-y / about_x, x / about_y])

    def _gain(self, spin: float) -> Array:
        place = min(max(spin - _SPINS_RAD_S[0], 0.0), len(_SPINS_RAD_S) - 1.0 - _SAME_SAMPLE)
        first = int(place)
        gain: Array = self._gains[first] + (place - first) * (self._gains[first + 1] - self._gains[first])
        return gain

    def _designed(self, interval_s: float, follows: float) -> Array:
        opened = (_SPINS_RAD_S - _NO_CONE_RAD_S) / (_WHOLE_CONE_RAD_S - _NO_CONE_RAD_S)
        newton = _FORCE_PART * self._weight_n / 4.0
        Q = np.diag(1.0 / np.array([_DIRECTION, _DIRECTION, _RATE, _RATE, inf, inf]) ** 2)
        gains = []
        for spin, part in zip(_SPINS_RAD_S.tolist(), np.clip(opened, _SCARCE, 1.0).tolist(), strict=True):
            sampled = expm(self._model(spin, interval_s, follows) * interval_s)
            R = np.diag(1.0 / np.array([newton, newton * part]) ** 2)
            gains.append(lqr(sampled[:6, :6], sampled[:6, 6:], Q, R)[1])
        return np.array(gains)

    def _model(self, spin: float, interval_s: float, follows: float) -> Array:
        r = spin * self.trio.sign
        (hx, hy), (p, q), _ = self.solution(spin)
        hz = sqrt(1.0 - hx * hx - hy * hy)
        ix, iy, iz = self._inertia
        M = np.zeros((8, 8))
        M[0, :4] = q * hx / hz, r + q * hy / hz, 0.0, -hz
        M[1, :4] = -r - p * hx / hz, -p * hy / hz, hz, 0.0
        M[2, 3] = (r * (iy - iz) - self._momentum) / ix
        M[3, 2] = (r * (iz - ix) + self._momentum) / iy
        M[2:4, 4] = self._per_difference / (ix, iy)
        M[2:4, 5] = self._per_opposite / (ix, iy)
        lag_1_s = -log(max(1.0 - follows, exp(-20.0))) / interval_s
        M[4, 4], M[5, 5], M[4, 6], M[5, 7] = -lag_1_s, -lag_1_s, lag_1_s, lag_1_s
        return M


def trio_without(vehicle: Vehicle, lost: int) -> Trio:
    """Return the rotors left; ThreeRotorsError unless they turn in two pairs."""
    torque = vehicle.allocation()[3]
    same = [i for i in range(4) if torque[i] * torque[lost] > 0.0]
    others = [i for i in range(4) if i not in same]
    if len(same) != len(others):
        raise ThreeRotorsError("its rotors do not turn in two pairs")
    (o,) = (i for i in same if i != lost)
    a, b = others
    return Trio(lost, a, b, o, 1.0 if torque[a] > 0.0 else -1.0)


def balancing_thrust(vehicle: Vehicle, trio: Trio, spin_rad_s: float) -> float:
    """Return the opposite rotor's thrust, N, that balances drag and rotor torque at a spin.

    In-plane drag at the hubs, which move at ω × r, makes a yaw moment of -c Ω r².
    """
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    low, high = 0.0, 0.5 * weight_n
    left = list(trio[1:4])
    thrust, torque = vehicle.allocation()[:, left][[0, 3]].copy()
    hubs_m = np.array(vehicle.rotors.position_m)[left]
    drag = (hubs_m * hubs_m).sum(axis=1)
    coefficient = 0.0 if vehicle.drag is None else vehicle.drag.rotor_coefficient
    for _ in range(_BISECTIONS):
        opposite_n = 0.5 * (low + high)
        speeds = _speeds(weight_n, thrust, opposite_n)
        if trio.sign * dot(torque, speeds**2) > coefficient * dot(speeds, drag) * spin_rad_s:
            low = opposite_n
        else:
            high = opposite_n
    return low


def _speeds(weight_n: float, thrust: Array, opposite_n: float) -> Array:
    pair_n = 0.5 * (weight_n - opposite_n)
    return np.sqrt(np.array([pair_n, pair_n, opposite_n]) / thrust)


def _momentum(vehicle: Vehicle, trio: Trio, opposite_n: float) -> float:
    left = list(trio[1:4])
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return dot(vehicle.rotor_momentum()[left], _speeds(weight_n, vehicle.allocation()[0, left], opposite_n))
