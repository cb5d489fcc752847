"""The attitude's LQR of `lpv-mpc`, source of its terminal weight and fallback, for certification."""

from itertools import product
from math import exp, radians, tan
from typing import Any

import numpy as np

from colibri.autopilot.control.lpv_mpc.attitude_mpc import AttitudeMpc, body_of
from colibri.autopilot.control.lpv_mpc.law import LpvMpcSettings
from colibri.autopilot.control.lpv_mpc.outer_loop import OuterLoop
from colibri.autopilot.control.lpv_mpc.prediction import INPUTS, PHI, STATES, THETA
from colibri.autopilot.control.qp import QpSolver
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.rotor_lag import rotor_lag
from colibri.certification.attitude import AttitudeNumbers, Kinematic, attitude_loop
from colibri.certification.certificate import Entry
from colibri.certification.flights import AttitudeLaw, Conditions, Flyer, Momentum
from colibri.certification.loop import AnyArray, Number, UncertainLoop
from colibri.common.config import read_settings
from colibri.common.elementary import square
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_TILT = [PHI, THETA]
_DIGITS = 10
"""Precision of chosen numbers: short ones keep exact arithmetic short."""


class LqrAttitude(AttitudeLaw):
    """The LQR of a profile's attitude."""

    what = "LQR of the attitude of lpv-mpc"
    axes = ("φ", "θ", "ψ")
    not_proven = ("the gain of the plan itself", "the moment of rotors that are spun up")

    def __init__(self, table: dict[str, Any], vehicle: Vehicle, conditions: Conditions) -> None:
        settings = read_settings(table, LpvMpcSettings)
        self.interval_s = settings.control_interval_s
        self._settings, self._vehicle, self.conditions = settings.attitude, vehicle, conditions
        lag = rotor_lag(vehicle, self.interval_s)
        solver = QpSolver(settings.qp.solver, settings.qp.tolerance, settings.qp.max_iterations)
        self.mpc = AttitudeMpc(settings.attitude, vehicle, lag, solver, self.interval_s, lambda: 0.0)
        self.body, self.terminal_weight = body_of(vehicle), self.mpc.problem.terminal_weight
        capacity_ah = vehicle.battery.capacity_ah if vehicle.battery else 0.0
        self._max_squared = square(BatteryModel(vehicle).max_common_speed(conditions.charge_part * capacity_ah))
        outer_loop = OuterLoop(settings.guidance, vehicle, lag, self.interval_s, self.mpc.horizon)
        limits = outer_loop.limits(self._max_squared**0.5)
        hover_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
        self.thrust_n = (limits.min_n, hover_n, limits.max_n)

    def loop(self, numbers: AttitudeNumbers, number: Number) -> UncertainLoop:
        return attitude_loop(numbers, number, of_euler_angles)

    def ranges(self, numbers: AttitudeNumbers) -> str:
        phi, theta = np.degrees(2.0 * np.arctan(numbers.angles))
        return f"{phi:.1f}, {theta:.1f}, any"

    def held(self, entry: Entry) -> Array:
        limits = np.asarray(self.loop(entry.numbers, float).limits, dtype=float)
        room: Array = 1.0 / limits[[0, 1], _TILT] - entry.proof.reach(np.eye(STATES + INPUTS)[_TILT])
        return room

    def flyer(self, entry: Entry, held: Array, rng: np.random.Generator) -> Flyer:
        return _LqrFlyer(entry.numbers, held, rng)

    def numbers_at(self, scale: float) -> AttitudeNumbers:
        vehicle, problem, body = self._vehicle, self.mpc.problem, self.body
        rotors = vehicle.rotors
        least, most = self.thrusts_n(scale)
        squared = problem.from_thrust
        headroom = min(self._max_squared - max(squared * most), min(squared * least) - problem.min_squared)
        speeds = self._max_squared**0.5 - problem.min_squared**0.5
        momentum = abs(vehicle.rotor_momentum()).sum() / 2 * speeds * rotors.max_speed
        angle = radians(self._settings.max_angle_deg) * scale
        commanded = np.eye(3, 12, 9) - self.mpc.gain
        lag_s = 1.0 / body.lag_1_s if body.lag_1_s else 0.0
        return AttitudeNumbers(
            interval_s=self.interval_s,
            lag_s=lag_s,
            stays=exp(-self.interval_s / lag_s) if lag_s else 0.0,
            inertia_kg_m2=[body.ix, body.iy, body.iz],
            commanded=[commanded.tolist()] * 2,
            unsure=np.zeros((2, *commanded.shape)).tolist(),
            angles=[round(tan(angle / 2), _DIGITS)] * 2,
            rates_rad_s=[round(scale * rate, _DIGITS) for rate in self._settings.max_rate_rad_s],
            momentum_n_m_s=round(momentum, _DIGITS),
            spin_s=0.0,
            spin_spread_s=[0.0] * 3,
            max_increment_n_m=list(self._settings.max_increment_n_m),
            from_moments=problem.from_moments.tolist(),
            to_moments=(vehicle.allocation()[1:] * square(rotors.max_speed)).tolist(),
            headroom=round(float(headroom), _DIGITS),
            disturbance_n_m=self.conditions.disturbance_n_m,
            angle_weight=np.asarray(problem.output_weight).tolist(),
            rate_weight=[0.0] * 3,
            increment_weight=np.asarray(problem.increment_weight).tolist(),
        )


class _LqrFlyer:
    """Flights under the gain."""

    def __init__(self, numbers: AttitudeNumbers, held: Array, rng: np.random.Generator) -> None:
        self._numbers, self._held, self._rng = numbers, held, rng

    def commands(self, z: Array) -> tuple[Array, Array]:
        commands = z @ np.array(self._numbers.commanded[0]).T
        return commands, commands

    def turn(self, angles: Array, rates: Array) -> Array:
        phi, theta = (angles[:, :2] + self._held).T
        p, q, r = rates.T
        across = np.sin(phi) * q + np.cos(phi) * r
        return np.column_stack([p + np.tan(theta) * across, np.cos(phi) * q - np.sin(phi) * r, across / np.cos(theta)])

    def momentum(self) -> Momentum:
        constant = self._rng.uniform(-1.0, 1.0, len(self._held)) * self._numbers.momentum_n_m_s
        return lambda _moments, _changes: (constant, 0.0 * constant)


def of_euler_angles(n: AttitudeNumbers) -> Kinematic:
    """Return T(phi, theta) [2.7] for half angles with tangents `n.angles`; psi is unlimited.

    T is the product of the points (sin φ, cos φ) and (tan θ, 1 / cos θ), each within a polygon of its chord and
    tangents. All vertices are rational.
    """
    (t, u), (p, q, r) = n.angles, n.rates_rad_s
    sine, cosine = 2 * t / (1 + t * t), (1 - t * t) / (1 + t * t)
    tangent, secant = 2 * u / (1 - u * u), (1 + u * u) / (1 - u * u)
    roll = ((-sine, cosine), (-t, 1), (t, 1), (sine, cosine))
    pitch = ((-tangent, secant), (-u, 1), (u, 1), (tangent, secant))
    phi_rate, theta_rate = p + tangent * (sine * q + r), q + sine * r
    steep, slope = secant * secant * theta_rate, secant * tangent * theta_rate
    change = [  # of each entry of T, every factor at its largest
        [0, tangent * phi_rate + sine * steep, sine * tangent * phi_rate + steep],
        [0, sine * phi_rate, phi_rate],
        [0, secant * phi_rate + sine * slope, secant * sine * phi_rate + slope],
    ]
    vertices = np.array([_of_points(*x, *y) for x, y in product(roll, pitch)])
    angles = 2 * n.angles - 2 * n.angles**3 / 3  # the arcus tangent's series, whose next term is positive
    return Kinematic(vertices, np.array(change), angles)


def _of_points(sine: Any, cosine: Any, tangent: Any, secant: Any) -> AnyArray:
    return np.array([[1, sine * tangent, cosine * tangent], [0, cosine, -sine], [0, sine * secant, cosine * secant]])
