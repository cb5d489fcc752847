"""Thrust, tilt and body rate that a track requires, and a vehicle's limits.

Position is a flat output: Mellinger and Kumar, ICRA 2011; with drag: Faessler et al., RA-L 2018. The moment about z is
left out because control laws sacrifice yaw.
"""

from dataclasses import dataclass
from math import degrees, inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.profile import Profile, ProfileError
from colibri.autopilot.control.vehicle_model.airframe import airframe_of
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.mixer import exact_inverse
from colibri.autopilot.guidance.trajectories.tracks import DURATION_S, Track, position
from colibri.common import elementwise
from colibri.common.elementary import square
from colibri.common.matrices import inverse
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

INTERVAL_S = 0.01  # of the samples of a track
_SNAP = 4
_MAX_TILT_DEG = 80.0  # for control laws without a tilt limit: beyond, the vertical thrust is too small
_SMALL_N = 1e-3
_LEAST_THRUST = 0.05  # part of the weight: for less thrust, the turn rate is meaningless
_CHARGE_SAMPLES = 10  # step of the charge integration, in multiples of `INTERVAL_S`
_REFINEMENTS = 3
_RESPONSE_SAMPLES = 20  # control laws return to the reference within about 0.2 s


@dataclass(frozen=True, slots=True)
class Demand:
    """A required quantity, (n,), and its limit, a minimum if it `falls`."""

    name: str
    unit: str
    values: Array
    limit: float
    span: float
    falls: bool = False

    def excess(self, margin: float) -> Array:
        """Return the ratio to the limit with `margin` of the range reserved, (n,)."""
        if self.falls:
            return (self.limit + margin * self.span) / np.maximum(self.values, _SMALL_N)
        excess: Array = self.values / (self.limit - margin * self.span)
        return excess

    def beyond(self, margin: float) -> Array:
        """Return the excess in parts of the range, `margin` of it reserved below a maximum, (n,); < 0 if feasible."""
        beyond: Array = (
            (self.limit - self.values) / self.span if self.falls else (self.values - self.limit) / self.span + margin
        )
        return beyond

    def __str__(self) -> str:
        value, most = (self.values.min(), "least") if self.falls else (self.values.max(), "most")
        return f"{self.name} of {value:.3g} {self.unit}, where {self.limit:.3g} is the {most}"


class Derivatives(NamedTuple):
    """Derivatives of position, ENU, (n, 3) each."""

    velocity: Array
    acceleration: Array
    jerk: Array
    snap: Array


class _Pulled(NamedTuple):
    """Force along the thrust, N, ENU, (n, 3), with drag, N s/m, and thrust, N, (n, 1)."""

    force: Array
    drag: Array
    thrust_n: Array


class Reach:
    """The limits of one vehicle under one profile; `exact_drag` is for the actual thrust and tilt instead of hover."""

    def __init__(self, vehicle: Vehicle, profile: Profile, *, exact_drag: bool = False) -> None:
        self._exact_drag = exact_drag
        self._vehicle = vehicle
        self._airframe = airframe_of(vehicle)
        self._battery = BatteryModel(vehicle)
        allocation = vehicle.allocation()
        mixed = inverse(allocation) if vehicle.rotors.count == len(allocation) else exact_inverse(allocation)
        self._mixed = np.abs(mixed) * vehicle.rotors.thrust_coefficient
        law = profile.of(vehicle).table(profile.controller)
        try:
            self._max_tilt_deg = float(law.get("guidance", {}).get("max_tilt_deg", _MAX_TILT_DEG))
            predicted = law.get("plan", law.get("attitude", {}))
            self._max_rate = float(min(predicted.get("max_rate_rad_s", (inf,))[:2]))
        except (AttributeError, TypeError, ValueError) as error:
            raise ProfileError(f"controllers.{profile.controller}: max_tilt_deg, max_rate_rad_s: {error}") from error

    def charge_of_hover(self, duration_s: float) -> float:
        rotors = self._vehicle.rotors
        hovering = np.full(len(rotors.position_m), self._vehicle.hover_speed / rotors.max_speed)
        return self._battery.charge_after(0.0, hovering, duration_s)

    def charge_of(self, motion: Derivatives) -> float:
        rotors, interval_s, charge_ah = self._vehicle.rotors, _CHARGE_SAMPLES * INTERVAL_S, 0.0
        some = Derivatives(*(column[::_CHARGE_SAMPLES] for column in motion))
        thrust = np.maximum(self._pulled(some).thrust_n[:, 0], 0.0)
        speeds = np.sqrt(thrust / (len(rotors.position_m) * rotors.thrust_coefficient)) / rotors.max_speed
        for speed in speeds:
            charge_ah = self._battery.charge_after(charge_ah, np.full(len(rotors.position_m), speed), interval_s)
        return charge_ah

    def demands(self, motion: Derivatives, charge_ah: float) -> list[Demand]:
        """Return the demands of a motion; limits are after `charge_ah` was taken from the battery."""
        _, a, j, s = motion
        mass = self._airframe.mass_kg
        pulled = self._pulled(motion)
        force, rate, turn = pulled.force, mass * j + pulled.drag * a, mass * s + pulled.drag * j
        carrying = np.maximum(_length(force)[:, None], _LEAST_THRUST * (mass * self._airframe.gravity_m_s2))
        up = force / carrying
        thrust_rate = _dot(up, rate)[:, None]
        up_rate = (rate - thrust_rate * up) / carrying
        up_turn = (turn - 2.0 * thrust_rate * up_rate) / carrying
        up_turn -= _dot(up, up_turn)[:, None] * up
        tilt = degrees(1.0) * elementwise.atan2(_length(force[:, :2]), force[:, 2])
        demands = self._of_rotors(pulled.thrust_n, _length(up_turn)[:, None], charge_ah)
        demands.append(Demand("tilt", "degrees", tilt, self._max_tilt_deg, self._max_tilt_deg))
        if isfinite(self._max_rate):
            demands.append(Demand("body rate", "rad/s", _length(up_rate), self._max_rate, self._max_rate))
        return demands

    def _pulled(self, motion: Derivatives) -> "_Pulled":
        """Split the force into thrust and drag, c (v - (v·z) z) across the rotor axis and c_z (v·z) z along it.

        With c = c_xy + c_r √T, T z = m (a + g) + c v + (c_z - c) (v·z) z: thrust points along m (a + g) + c v.
        """
        airframe, v = self._airframe, motion.velocity
        hover_drag = airframe.drag_xy + airframe.rotor_drag * sqrt(airframe.mass_kg * airframe.gravity_m_s2)
        drag: Array = np.full((len(v), 1), hover_drag)
        force = self._force(motion, drag)
        thrust = _length(force)[:, None]
        for _ in range(_REFINEMENTS if self._exact_drag else 0):
            drag = airframe.drag_xy + airframe.rotor_drag * np.sqrt(np.maximum(thrust, 0.0))
            force = self._force(motion, drag)
            length = _length(force)[:, None]
            thrust = length + (airframe.drag_z - drag) * _dot(force, v)[:, None] / np.maximum(length, _SMALL_N)
        return _Pulled(force, drag, thrust)

    def _force(self, motion: Derivatives, drag: Array) -> Array:
        """Return m (a + g) + c v, N, ENU, (n, 3)."""
        force = self._airframe.mass_kg * motion.acceleration + drag * motion.velocity
        force[:, 2] += self._airframe.mass_kg * self._airframe.gravity_m_s2
        return force

    def _of_rotors(self, thrust_n: Array, turn_rad_s2: Array, charge_ah: float) -> list[Demand]:
        share, lever = self._mixed[:, 0], _length(self._mixed[:, 1:3])
        moment = max(self._vehicle.body.inertia_kg_m2[:2]) * turn_rad_s2
        rotors = self._vehicle.rotors
        top = self._battery.max_common_speed(charge_ah) * rotors.max_speed
        least, most = (rotors.thrust_coefficient * square(speed) for speed in (rotors.idle_speed, top))
        even, apart, span_n = thrust_n * share, moment * lever, most - least
        return [
            Demand("thrust", "N a rotor", (even + apart).max(axis=1), most, span_n),
            Demand("thrust", "N a rotor", (even - apart).min(axis=1), least, span_n, falls=True),
        ]


def times(track: Track) -> Array:
    """Return sampling times, s; the first 100 s of an endless track."""
    return np.arange(0.0, DURATION_S if track.duration_s == inf else track.duration_s, INTERVAL_S)


def exact_motion(track: Track) -> Derivatives:
    axes = track.position(track.clock(times(track), _SNAP))
    return Derivatives(*(np.stack([axis.derivative(order) for axis in axes], axis=1) for order in range(1, _SNAP + 1)))


def mean_motion(track: Track) -> Derivatives:
    """Return the motion by differences over the response time of a control law, which rounds steps off."""
    t, apart = times(track), _RESPONSE_SAMPLES
    around = INTERVAL_S * np.arange(-2 * apart, len(t) + 2 * apart)
    p = position(track, np.clip(around, 0.0, track.duration_s))
    far_back, back, here, ahead, far_ahead = (p[k * apart : k * apart + len(t)] for k in range(5))
    h = INTERVAL_S * apart
    return Derivatives(
        (ahead - back) / (2.0 * h),
        (ahead - 2.0 * here + back) / (h * h),
        (far_ahead - 2.0 * ahead + 2.0 * back - far_back) / (2.0 * h * h * h),
        (far_ahead - 4.0 * ahead + 6.0 * here - 4.0 * back + far_back) / (h * h * h * h),
    )


def _dot(a: Array, b: Array) -> Array:
    product = a * b
    total: Array = product[:, 0] + product[:, 1] + product[:, 2]
    return total


def _length(a: Array) -> Array:
    total = a[:, 0] * a[:, 0]
    for axis in a.T[1:]:
        total = total + axis * axis
    return np.sqrt(total)
