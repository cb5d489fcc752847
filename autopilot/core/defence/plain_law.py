"""The plain law, which replaces a failed control law, without plan or solver; and by it the descent, the last resort.

Velocity by PI towards a near place; the thrust axis turned the shortest way, yaw only damped. Attitude and mixer are
those of the LPV-MPC's recovery, valid from any attitude and at any speed.
"""

from math import hypot, radians

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, Decision, Horizon, VehicleState
from colibri.autopilot.control.parts.recovery import TurnGains, mix_with_priority, turning_moment
from colibri.autopilot.control.rotor_loss.three_rotors import angles_of
from colibri.autopilot.control.vehicle_model.mixer import Mixing, exact_inverse
from colibri.common.compiled_rotations import quaternion_from_euler
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.kernels import tan
from colibri.common.matrices import matvec, norm
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_VELOCITY_1_S, _INTEGRAL_1_S2, _PLACE_1_S = 3.0, 1.0, 0.75
_APPROACH_M_S = 3.0
_MAX_TILT_RAD = radians(35.0)
_MAX_LIFT_M_S2 = 4.0
_TURN_PART, _RATE_PART, _MAX_RATE_1_S = 0.3, 0.66, 20.0
"""The rate follows in the time of the rotors' lag and a sample, the attitude three times as slowly."""
_MAX_RATE_RAD_S = 6.0
_NOWHERE = np.zeros(3)
_SINK_1_S, _LEAST_M_S, _MOST_M_S = 0.5, 0.7, 2.0  # of the descent: as fast as the height allows
_HELD_FOR_US = 700_000
_SLOWER = 0.3  # part of the commanded sink rate


class PlainLaw:
    """The plain law of one vehicle, with the integral of its velocity error."""

    def __init__(self, vehicle: Vehicle, interval_s: float) -> None:
        self._interval_s = interval_s
        self._max_speed = vehicle.rotors.max_speed
        self._min_squared = square(vehicle.rotors.idle_speed / self._max_speed)
        allocation, top = vehicle.allocation(), square(self._max_speed)
        self._mixing = packed(Mixing(allocation * top, exact_inverse(allocation) / top))
        self._inertia = np.array(vehicle.body.inertia_kg_m2)
        self._mass_kg, self._gravity = vehicle.body.mass_kg, vehicle.gravity_m_s2
        lag_s = vehicle.rotors.lag.time_constant_down_s if vehicle.rotors.lag else 0.0
        rate_1_s = min(_RATE_PART / (lag_s + interval_s), _MAX_RATE_1_S)
        self._turn = TurnGains(_TURN_PART * rate_1_s, rate_1_s, _MAX_RATE_RAD_S)
        self._integral = _NOWHERE

    def step(self, state: VehicleState, references: Horizon) -> Decision:
        """Decide the rotor speeds by the first of the references."""
        place = references.position_enu_m[0] - np.array(state.position_enu_m)
        towards = _shortened(_PLACE_1_S * place, _APPROACH_M_S)
        velocity = references.velocity_enu_m_s[0] + towards
        return self.by_velocity(state, velocity, references.acceleration_enu_m_s2[0])

    def by_velocity(self, state: VehicleState, velocity: Array, acceleration: Array = _NOWHERE) -> Decision:
        """Decide by a velocity, m/s, ENU, (3,), and an acceleration, m/s²."""
        error = velocity - np.array(state.velocity_enu_m_s)
        flat = self._gravity * tan(_MAX_TILT_RAD)
        wanted = _limited(_VELOCITY_1_S * error + self._integral + acceleration, flat)
        integral = self._integral + _INTEGRAL_1_S2 * self._interval_s * _limited(error, 1.0)
        self._integral = _limited(integral, 0.5 * flat)
        wanted[2] += self._gravity
        return self._decide(state, wanted, self._mass_kg * norm(wanted))

    def step_attitude(self, state: VehicleState, demand: AttitudeDemand) -> Decision:
        phi, theta, psi = demand.angles[0].tolist()
        up = np.array(rotation_matrix(quaternion_from_euler(phi, theta, psi)))[:, 2].copy()
        return self._decide(state, up, float(demand.thrust_n[0]))

    def _decide(self, state: VehicleState, along: Array, thrust_n: float) -> Decision:
        """Turn the thrust axis to `along`, (3,); thrust as far as it points there."""
        R = np.array(rotation_matrix(state.attitude))
        direction = matvec(R.T, along / norm(along))
        moments = turning_moment(direction, np.array(state.rate_flu_rad_s), self._inertia, self._turn)
        thrust_n = max(thrust_n * float(direction[2]), 0.0)
        squared = mix_with_priority(thrust_n, moments, self._mixing, self._min_squared, 1.0)
        return Decision(np.sqrt(squared) * self._max_speed, angles_of(along / norm(along), state.euler[2]))


class Descent:
    """Brake, descend, and stop the rotors on the ground at z = `ground_m`, ENU; a `standing` vehicle stays there."""

    def __init__(self, now_us: int, ground_m: float, *, standing: bool) -> None:
        self._ground_m = ground_m
        self._sinks_since_us = self._held_since_us = now_us
        self.landed = standing

    def step(self, law: PlainLaw, now_us: int, state: VehicleState) -> Decision | None:
        sink_m_s = min(max(_SINK_1_S * (state.position_enu_m[2] - self._ground_m), _LEAST_M_S), _MOST_M_S)
        if now_us - self._sinks_since_us < _HELD_FOR_US or abs(state.velocity_enu_m_s[2]) > _SLOWER * sink_m_s:
            self._held_since_us = now_us
        self.landed = self.landed or now_us - self._held_since_us >= _HELD_FOR_US
        return None if self.landed else law.by_velocity(state, np.array([0.0, 0.0, -sink_m_s]))


def _shortened(vector: Array, longest: float) -> Array:
    length = norm(vector)
    return vector * (longest / length) if length > longest else vector


def _limited(acceleration: Array, flat: float) -> Array:
    limited = acceleration.copy()
    length = hypot(limited[0], limited[1])
    if length > flat:
        limited[:2] *= flat / length
    limited[2] = min(max(limited[2], -_MAX_LIFT_M_S2), _MAX_LIFT_M_S2)
    return limited
