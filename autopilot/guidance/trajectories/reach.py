"""What a vehicle can fly: the thrust, tilt and body rate that a track asks for, beside those that there are.

Position is a flat output: acceleration, gravity and drag give the thrust and its direction, jerk the rate at which that
direction turns, snap its acceleration, and so the moment of the rotors. Source: Mellinger and Kumar, ICRA 2011; with
drag: Faessler et al., RA-L 2018. Yaw is left out: a law gives way in it, so the rotors' moment about z is not counted.
"""

from dataclasses import dataclass
from math import degrees, inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.vehicle_model.airframe import airframe_of
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.guidance.trajectories.tracks import DURATION_S, Track, position
from colibri.common import elementwise
from colibri.common.elementary import square
from colibri.common.matrices import inverse
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

INTERVAL_S = 0.01
"""Between the times at which a track is looked at."""
MARGIN = 0.1
"""Part of each range that a stretched path leaves to the control law, to come back to the path, also in wind."""

_SNAP = 4
_MAX_TILT_DEG = 80.0
"""Of a law that names no limit: further over, hardly any thrust is left to carry the vehicle."""
_SMALL_N = 1e-3
_LEAST_THRUST = 0.05
"""Part of the weight: the direction of less thrust than that turns at no rate worth a number."""
_RESPONSE_SAMPLES = 20
"""A law comes back to its reference within about 0.2 s."""


@dataclass(frozen=True, slots=True)
class Demand:
    """One quantity that a track asks for, and its limit.

    Attributes:
        name: Of the quantity.
        unit: Of the quantity.
        values: At each time, (n,).
        limit: The most that there is; the least if `falls`.
        span: Range of the quantity.
        falls: Whether less is asked for than there may be.
    """

    name: str
    unit: str
    values: Array
    limit: float
    span: float
    falls: bool = False

    def excess(self, margin: float) -> Array:
        """Return how many times too much is asked for if `margin` of the range is to be left, (n,)."""
        if self.falls:
            return (self.limit + margin * self.span) / np.maximum(self.values, _SMALL_N)
        excess: Array = self.values / (self.limit - margin * self.span)
        return excess

    def __str__(self) -> str:
        """Return the most that is asked for, beside the limit."""
        value, most = (self.values.min(), "least") if self.falls else (self.values.max(), "most")
        return f"{self.name} of {value:.3g} {self.unit}, where {self.limit:.3g} is the {most}"


class Motion(NamedTuple):
    """Velocity, acceleration, jerk and snap at each time, m, s, ENU, (n, 3) each."""

    velocity: Array
    acceleration: Array
    jerk: Array
    snap: Array


class Reach:
    """The limits of one vehicle under one profile."""

    def __init__(self, vehicle: Vehicle, profile: Profile) -> None:
        """Take the rotors' limits of `vehicle`, and those of tilt and body rates of the profile's law if it has any."""
        self._vehicle = vehicle
        self._airframe = airframe_of(vehicle)
        self._battery = BatteryModel(vehicle)
        self._mixed = np.abs(inverse(vehicle.allocation())) * vehicle.rotors.thrust_coefficient
        law = profile.table(profile.controller)
        self._max_tilt_deg = float(law.get("guidance", {}).get("max_tilt_deg", _MAX_TILT_DEG))
        self._max_rate = float(min(law.get("attitude", {}).get("max_rate_rad_s", (inf,))[:2]))

    def demands(self, motion: Motion, duration_s: float) -> list[Demand]:
        """Return what a motion of that duration asks for."""
        v, a, j, s = motion
        mass, drag = self._airframe.mass_kg, self._drag_n_s_m
        force, rate, turn = mass * a + drag * v, mass * j + drag * a, mass * s + drag * j
        weight_n = mass * self._airframe.gravity_m_s2
        force[:, 2] += weight_n
        thrust = _length(force)[:, None]
        carrying = np.maximum(thrust, _LEAST_THRUST * weight_n)
        up = force / carrying
        thrust_rate = _dot(up, rate)[:, None]
        up_rate = (rate - thrust_rate * up) / carrying
        up_turn = (turn - 2.0 * thrust_rate * up_rate) / carrying
        up_turn -= _dot(up, up_turn)[:, None] * up
        tilt = degrees(1.0) * elementwise.atan2(_length(force[:, :2]), force[:, 2])
        demands = self._of_rotors(thrust, _length(up_turn)[:, None], duration_s)
        demands.append(Demand("tilt", "degrees", tilt, self._max_tilt_deg, self._max_tilt_deg))
        if isfinite(self._max_rate):
            demands.append(Demand("body rate", "rad/s", _length(up_rate), self._max_rate, self._max_rate))
        return demands

    def _of_rotors(self, thrust_n: Array, turn_rad_s2: Array, duration_s: float) -> list[Demand]:
        """Return what is asked of the rotors: the moment may be about any axis of their plane.

        Their limits are those on what the battery has left after so long a hover.
        """
        share, lever = self._mixed[:, 0], _length(self._mixed[:, 1:3])
        moment = max(self._vehicle.body.inertia_kg_m2[:2]) * turn_rad_s2
        rotors = self._vehicle.rotors
        hovering = np.full(len(rotors.position_m), self._vehicle.hover_speed / rotors.max_speed)
        top = self._battery.max_common_speed(self._battery.charge_after(0.0, hovering, duration_s)) * rotors.max_speed
        least, most = (rotors.thrust_coefficient * square(speed) for speed in (rotors.idle_speed, top))
        even, apart, span_n = thrust_n * share, moment * lever, most - least
        return [
            Demand("thrust", "N a rotor", (even + apart).max(axis=1), most, span_n),
            Demand("thrust", "N a rotor", (even - apart).min(axis=1), least, span_n, falls=True),
        ]

    @property
    def _drag_n_s_m(self) -> float:
        airframe = self._airframe
        return airframe.drag_xy + airframe.rotor_drag * sqrt(airframe.mass_kg * airframe.gravity_m_s2)


def times(track: Track) -> Array:
    """Return the times at which a track is looked at, s, (n,); of one without end its first 100 s."""
    return np.arange(0.0, DURATION_S if track.duration_s == inf else track.duration_s, INTERVAL_S)


def exact_motion(track: Track) -> Motion:
    """Return the motion of a track as it is."""
    axes = track.position(track.clock(times(track), _SNAP))
    return Motion(*(np.stack([axis.derivative(order) for axis in axes], axis=1) for order in range(1, _SNAP + 1)))


def mean_motion(track: Track) -> Motion:
    """Return the motion of a track by differences, over as long as a law takes to come back to it.

    What a path asks for is then what a vehicle cannot evade, and not the start of a step that it cuts short.
    """
    t, apart = times(track), _RESPONSE_SAMPLES
    around = INTERVAL_S * np.arange(-2 * apart, len(t) + 2 * apart)
    p = position(track, np.clip(around, 0.0, track.duration_s))
    far_back, back, here, ahead, far_ahead = (p[k * apart : k * apart + len(t)] for k in range(5))
    h = INTERVAL_S * apart
    return Motion(
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
    """Return the lengths of vectors, (n,), of two or three axes."""
    total = a[:, 0] * a[:, 0]
    for axis in a.T[1:]:
        total = total + axis * axis
    return np.sqrt(total)
