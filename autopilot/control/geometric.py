"""A geometric tracking controller on SE(3), as a baseline for the LPV-MPC.

T. Lee, M. Leok, N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010; equation numbers
in brackets. In ENU and FLU gravity and thrust change sign. All loops are critically damped. Commands lead slow rotors.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, Clock, Decision, Horizon, Preview, VehicleState
from colibri.autopilot.control.parts.recovery import mix_with_priority
from colibri.autopilot.control.scaling import capability_of, sagging_speed, scaled
from colibri.autopilot.control.settings import ControlInterval, interval_us
from colibri.autopilot.control.vehicle_model.mixer import mixing_of
from colibri.autopilot.control.vehicle_model.rotor_lag import SampledLag, lead, rotor_lag
from colibri.common.compiled_rotations import quaternion_from_euler
from colibri.common.config import NotNegative, Positive, Table, read_settings
from colibri.common.elementary import square
from colibri.common.kernels import asin, atan2, cos, exp, sin
from colibri.common.matrices import dot, matmul, matvec, norm
from colibri.common.rotations import nearest_turn, rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_MIN_FORCE = 0.05  # least demanded force in parts of the weight: a smaller one has no useful direction
_SATURATING_RAD = 0.13  # least attitude error that may saturate the moments: at less, the loop is unstable in wind
_MIN_FEEDBACK = 0.5  # least limit of the feedback in parts of gravity, else what is left beside hover with a payload
_MIN_LIFT = 0.5  # near the ground: least lift in parts of the weight, at which the target is level


class GeometricSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The natural frequencies of its three loops; those of position and attitude are scaled down for weak rotors."""

    control_interval_s: ControlInterval
    position_frequency_rad_s: Positive
    attitude_frequency_rad_s: Positive
    yaw_frequency_rad_s: Positive
    rotor_lag_s: NotNegative = 0.0
    """Lag of the forces with commands that lead. 0: commands do not lead."""


class AttitudeTarget(NamedTuple):
    """Rotation R_d (3, 3) and body rates Ω_d, rad/s, (3,)."""

    rotation: Array
    rate: Array


class GeometricController:
    """The control law."""

    reads_motion = True

    def __init__(self, table: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        del clock
        settings = read_settings(scaled("geometric-se3", table, vehicle), GeometricSettings)
        self.control_interval_us = interval_us(settings.control_interval_s)
        self.preview = Preview(self.control_interval_us, 1)
        self._mass_kg = vehicle.body.mass_kg
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self._inertia = np.array(vehicle.body.inertia_kg_m2)
        attitude_rad_s = min(settings.attitude_frequency_rad_s, _max_frequency_rad_s(vehicle))
        position_rad_s = settings.position_frequency_rad_s * (attitude_rad_s / settings.attitude_frequency_rad_s)
        self._k_position = square(position_rad_s)
        self._k_velocity = 2.0 * position_rad_s
        frequencies = np.array([attitude_rad_s] * 2 + [settings.yaw_frequency_rad_s])
        self._k_rotation = self._inertia * frequencies**2
        self._k_rate = self._inertia * 2.0 * frequencies
        top = square(vehicle.rotors.max_speed)
        self._mixing = mixing_of(vehicle.allocation() * top)
        self._top_speed = vehicle.rotors.max_speed
        self._lag = _led_lag(vehicle, settings, 1e-6 * self.control_interval_us)
        self._squared = square(vehicle.rotors.idle_speed) / top, square(sagging_speed(vehicle))
        self._max_feedback_m_s2 = max(capability_of(vehicle).climb_m_s2, _MIN_FEEDBACK * vehicle.gravity_m_s2)

    def initial(self, rotor_speed: float) -> None:
        del rotor_speed

    def step(self, memory: None, time_us: int, state: VehicleState, references: Horizon) -> tuple[None, Decision]:
        del memory, time_us
        R = np.array(rotation_matrix(state.attitude))
        rate = np.array(state.rate_flu_rad_s)
        acceleration, jerk = self._demand(state, references, R)
        target = track_direction(acceleration, jerk, float(references.yaw_rad[0]), float(references.yaw_rate_rad_s[0]))
        thrust_n = self._mass_kg * dot(acceleration, R[:, 2])  # [15]
        moment_n_m = self._moment(R, rate, target)
        speeds = self._rotor_speeds(state, max(thrust_n, 0.0), moment_n_m)
        return None, Decision(speeds, euler_of(target.rotation, float(references.yaw_rad[0])))

    def step_attitude(
        self, memory: None, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[None, Decision]:
        del memory, time_us
        phi, theta, psi = demand.angles[0].tolist()
        R = np.array(rotation_matrix(state.attitude))
        target = AttitudeTarget(
            np.array(rotation_matrix(quaternion_from_euler(phi, theta, psi))),
            body_rate_of(phi, theta, demand.angle_rates_rad_s[0]),
        )
        moment_n_m = self._moment(R, np.array(state.rate_flu_rad_s), target)
        speeds = self._rotor_speeds(state, max(float(demand.thrust_n[0]), 0.0), moment_n_m)
        return None, Decision(speeds, (phi, theta, psi))

    def _demand(self, state: VehicleState, references: Horizon, R: Array) -> tuple[Array, Array]:
        """Return the demanded specific force, m/s², [15], and its derivative, m/s³."""
        gravity = np.array([0.0, 0.0, self._gravity_m_s2])
        position_error = np.array(state.position_enu_m) - references.position_enu_m[0]
        velocity_error = np.array(state.velocity_enu_m_s) - references.velocity_enu_m_s[0]
        wanted = references.acceleration_enu_m_s2[0]
        feedback = -self._k_position * position_error - self._k_velocity * velocity_error
        size = norm(feedback)
        share = min(self._max_feedback_m_s2 / size, 1.0) if size > 0.0 else 1.0
        force = share * feedback + wanted + gravity
        floor = _MIN_FORCE * self._gravity_m_s2
        if norm(force) < floor:
            force = floor * R[:, 2]
        if not state.airborne:
            force = self._upright(force)
        lifted = dot(force, R[:, 2]) * R[:, 2] - gravity
        jerk = references.jerk_enu_m_s3[0]
        if share == 1.0:
            jerk = jerk - self._k_position * velocity_error - self._k_velocity * (lifted - wanted)
        return force, jerk

    def _rotor_speeds(self, state: VehicleState, thrust_n: float, moment_n_m: Array) -> Array:
        least, most = self._squared
        squared = mix_with_priority(thrust_n, moment_n_m, self._mixing, least, most)
        if self._lag is not None:
            led = lead(np.array(state.rotor_speeds) / self._top_speed, squared, self._lag, float(np.sqrt(most)))
            return led * self._top_speed
        speeds: Array = np.sqrt(squared) * self._top_speed
        return speeds

    def _upright(self, force: Array) -> Array:
        """Return the force for a vehicle near the ground: the less lift, the less tilt, so that it cannot tip over."""
        floor = _MIN_LIFT * self._gravity_m_s2
        lift = max(float(force[2]), floor)
        share = min((lift - floor) / max(norm(force[:2]), floor), 1.0)
        return np.array([share * force[0], share * force[1], lift])

    def _moment(self, R: Array, rate: Array, target: AttitudeTarget) -> Array:
        """Return the moment, N m, [16], without the target's angular acceleration."""
        difference = matmul(target.rotation.T, R)
        rotation_error = 0.5 * vee(difference - difference.T)  # [10]
        carried = matvec(difference.T, target.rate)
        rate_error = rate - carried  # [11]
        feedback = -self._k_rotation * rotation_error - self._k_rate * rate_error
        gyroscopic = np.cross(rate, self._inertia * rate) - self._inertia * np.cross(rate, carried)
        moment: Array = feedback + gyroscopic
        return moment


def _led_lag(vehicle: Vehicle, settings: GeometricSettings, interval_s: float) -> SampledLag | None:
    """Return the lag of rotors that are slower than the settings' lag."""
    wanted_s = settings.rotor_lag_s
    if not 0.0 < wanted_s < capability_of(vehicle).lag_s:
        return None
    return rotor_lag(vehicle, interval_s)._replace(planned=1.0 - exp(-interval_s / wanted_s))


def _max_frequency_rad_s(vehicle: Vehicle) -> float:
    """Return the natural frequency at which an error of `_SATURATING_RAD` takes all moment about roll or pitch."""
    hover, full = square(vehicle.hover_speed), square(vehicle.rotors.max_speed)
    moments_n_m = np.abs(vehicle.allocation()[1:3]).sum(axis=1) * max(min(hover, full - hover), 0.1 * full)
    return float(np.sqrt((moments_n_m / np.array(vehicle.body.inertia_kg_m2[:2])).min() / _SATURATING_RAD))


def track_direction(force: Array, force_rate: Array, yaw_rad: float, yaw_rate_rad_s: float) -> AttitudeTarget:
    """Return the attitude with body z along `force`, m/s², ENU, (3,), and its body rates."""
    heading = np.array([cos(yaw_rad), sin(yaw_rad), 0.0])
    heading_rate = yaw_rate_rad_s * np.array([-heading[1], heading[0], 0.0])
    z, z_rate = _unit(force, force_rate)
    y, y_rate = _unit(np.cross(z, heading), np.cross(z_rate, heading) + np.cross(z, heading_rate))
    x, x_rate = np.cross(y, z), np.cross(y_rate, z) + np.cross(y, z_rate)
    rotation = np.column_stack([x, y, z])
    return AttitudeTarget(rotation, vee(matmul(rotation.T, np.column_stack([x_rate, y_rate, z_rate]))))


def euler_of(rotation: Array, near_yaw_rad: float) -> tuple[float, float, float]:
    """Return phi, theta, psi, rad, with psi within half a turn of `near_yaw_rad`."""
    phi = atan2(rotation[2, 1], rotation[2, 2])
    theta = asin(min(max(-rotation[2, 0], -1.0), 1.0))
    psi = atan2(rotation[1, 0], rotation[0, 0])
    return phi, theta, nearest_turn(psi, near_yaw_rad)


def body_rate_of(phi: float, theta: float, angle_rates: Array) -> Array:
    """Invert THESIS [2.7]: Euler-angle rates to p, q, r."""
    s, c, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    return matvec(np.array([[1.0, 0.0, -st], [0.0, c, s * ct], [0.0, -s, c * ct]]), angle_rates)


def vee(skew: Array) -> Array:
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def _unit(vector: Array, rate: Array) -> tuple[Array, Array]:
    length = norm(vector)
    unit = vector / length
    return unit, (rate - unit * dot(unit, rate)) / length
