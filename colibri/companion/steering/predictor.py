"""Predict the state at a command's time of effect from the last state and the commands since.

The error of a prediction is a disturbance. Its lasting part along the thrust refines the thrust scale; a lasting error
of position is a drift of the estimate.
"""

from collections import deque
from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.profile import Profile
from colibri.common import rotations
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled, packed
from colibri.common.kernels import exp
from colibri.common.types import Array, Vector
from colibri.companion.stack import Response
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import Vehicle

STATES, COMMANDS = 17, 4
POSITION, VELOCITY, ATTITUDE, RATE, LIFT = slice(3), slice(3, 6), slice(6, 10), slice(10, 13), 13
"""Lift is thrust over mass, m/s²."""
ACCELERATION = slice(14, 17)  # acceleration of the body rates, rad/s²
_STEP_S = 0.004
_ROUNDING = 1e-6


class ResponseModel(NamedTuple):
    """Numbers of the model along p, q, r or FLU; drag is over mass."""

    time_constant_s: Array
    max_acceleration_rad_s2: Array
    acceleration_lag_s: Array
    lift_lag_s: float
    drag_1_s: Array
    gravity_m_s2: float


def response_model(vehicle: Vehicle, response: Response) -> ResponseModel:
    drag = np.zeros(3)
    if vehicle.drag is not None:
        in_plane = vehicle.drag.rotor_coefficient * len(vehicle.rotors.position_m) * vehicle.hover_speed
        drag = (np.array(vehicle.drag.linear_n_s_m) + np.array([in_plane, in_plane, 0.0])) / vehicle.body.mass_kg
    lags, limits = np.array(response.time_constant_s), np.array(response.max_acceleration_rad_s2)
    behind = np.array(response.acceleration_lag_s)
    return ResponseModel(lags, limits, behind, response.thrust_lag_s, drag, vehicle.gravity_m_s2)


def rate_command(rate: Vector, next_rate: Vector, interval_s: float, response: Response) -> Vector:
    """Return the rate commands that lead to `next_rate` in an interval, by the inverse without acceleration lag."""
    limits = (response.max_rate_rad_s, response.max_acceleration_rad_s2)
    axes = zip(rate, next_rate, response.time_constant_s, *limits, response.acceleration_lag_s, strict=True)
    p, q, r = (_rate_command(now, then, interval_s, *of) for now, then, *of in axes)
    return (p, q, r)


def _rate_command(
    now: float, then: float, interval_s: float, lag_s: float, max_rate: float, max_acceleration: float, behind_s: float
) -> float:
    change = min(max(then - now, -max_acceleration * interval_s), max_acceleration * interval_s)
    reached = interval_s / lag_s if behind_s > 0.0 else 1.0 - exp(-interval_s / lag_s)
    return min(max(now + change / reached, -max_rate), max_rate)


@compiled
def carry(y: Array, durations_s: Array, commands: Array, disturbance: Array, packed: Packed) -> Array:
    """Propagate y, (17,), through commands of `durations_s`, (n,).

    Args:
        y: Position, m, velocity, m/s, ENU; attitude, FLU to ENU; body rates, rad/s; lift, m/s²; rate acceleration,
            rad/s².
        commands: Body rates, rad/s, and lift, m/s², (n, 4).
        disturbance: Acceleration, ENU, m/s², and angular acceleration, FLU, rad/s², (6,).
        packed: The `ResponseModel`.
    """
    y = y.copy()
    model = packed[0]
    mean = np.empty(3)
    for n in range(durations_s.size):
        steps = max(1, ceil(durations_s[n] / _STEP_S - _ROUNDING))
        h = durations_s[n] / steps
        for _ in range(steps):
            for i in range(3):
                after = y[10 + i] + _change(y, i, commands[n, i], h, model) + h * disturbance[3 + i]
                mean[i] = 0.5 * (y[10 + i] + after)
                y[10 + i] = after
            lift = commands[n, 3]
            if model.lift_lag_s > 0.0:
                lift = commands[n, 3] + (y[13] - commands[n, 3]) * exp(-h / model.lift_lag_s)
            mean_lift = 0.5 * (y[13] + lift) if model.lift_lag_s > 0.0 else lift
            y[13] = lift
            _turn(y, mean, 0.5 * h)
            _push(y, mean_lift, disturbance, model.drag_1_s, model.gravity_m_s2, h)
            _turn(y, mean, 0.5 * h)
    return y


@compiled
def _change(y: Array, axis: int, command: float, h: float, model: ResponseModel) -> float:
    limit, lag_s = model.max_acceleration_rad_s2[axis], model.time_constant_s[axis]
    rate, acceleration, behind_s = y[10 + axis], y[14 + axis], model.acceleration_lag_s[axis]
    if behind_s == 0.0:
        change: float = (command - rate) * (1.0 - exp(-h / lag_s))
        change = min(max(change, -h * limit), h * limit)
        y[14 + axis] = change / h
        return change
    asked = (command - rate - 0.5 * h * acceleration) / lag_s
    asked = min(max(asked, -limit), limit)
    stays = exp(-h / behind_s)
    y[14 + axis] = asked + (acceleration - asked) * stays
    followed: float = h * asked + (acceleration - asked) * behind_s * (1.0 - stays)
    return followed


@compiled
def _turn(y: Array, rate: Array, h: float) -> None:
    w, x, a, b = y[6], y[7], y[8], y[9]
    p, q, r = 0.5 * h * rate[0], 0.5 * h * rate[1], 0.5 * h * rate[2]
    y[6] = w - x * p - a * q - b * r
    y[7] = x + w * p + a * r - b * q
    y[8] = a + w * q + b * p - x * r
    y[9] = b + w * r + x * q - a * p
    length = sqrt(y[6] * y[6] + y[7] * y[7] + y[8] * y[8] + y[9] * y[9])
    for i in range(6, 10):
        y[i] /= length


@compiled
def _push(y: Array, lift: float, disturbance: Array, drag: Array, gravity_m_s2: float, h: float) -> None:
    R = rotation_matrix((y[6], y[7], y[8], y[9]))
    along = np.empty(3)
    for i in range(3):
        along[i] = -drag[i] * (R[0][i] * y[3] + R[1][i] * y[4] + R[2][i] * y[5])
    along[2] += lift
    for i in range(3):
        a = R[i][0] * along[0] + R[i][1] * along[1] + R[i][2] * along[2] + disturbance[i]
        if i == 2:
            a -= gravity_m_s2
        y[i] += h * (y[3 + i] + 0.5 * h * a)
        y[3 + i] += h * a


_AS_TUNED_S = 0.06  # largest delay of a law as tuned
_MOST = 1.6
_WEIGHTS = {"position": -2.0, "velocity": 4.0, "rate": 6.0, "first_correction": 6.0, "next_correction": 6.0}
"""Power of the slowness in each weight."""


def delay_s(response: Response) -> float:
    """Return dead time and lag of roll and pitch rates, s; at second order the inverse undoes the rate loop."""
    pairs = zip(response.time_constant_s[:2], response.acceleration_lag_s[:2], strict=True)
    return response.latency_s + max(behind_s or lag_s for lag_s, behind_s in pairs)


def slowness(response: Response) -> float:
    """Return the factor of slowing, 1 or more."""
    return min(max(delay_s(response) / _AS_TUNED_S, 1.0), _MOST)


def slowed(profile: Profile, response: Response) -> Profile:
    """Slow a law down; laws with other weights are unchanged."""
    times = slowness(response)
    weights: Any = profile.table(profile.controller).get("weights")
    if times == 1.0 or not isinstance(weights, dict) or not _WEIGHTS.keys() <= weights.keys():
        return profile
    for name, power in _WEIGHTS.items():
        profile = profile.replace(f"controllers.{profile.controller}.weights.{name}", weights[name] * times**power)
    return profile


_FOLLOWS_US = 150_000  # a longer gap resets the disturbances
_KEPT_US = 1_000_000
_DRIFT_1_S = 8.0  # PX4 spreads each GPS correction over a quarter of a second
_MAX_DRIFT_M_S = 1.0
_DISTURBANCE_1_S = 6.0
_MAX_DISTURBANCE = np.array([6.0, 6.0, 6.0, 20.0, 20.0, 20.0])
_TURN_PART = 0.5  # part of the rate error that counts as disturbance
_TURN_POWER = 8.0  # the later the rates follow, the more of their error is the model's
_CORRECTED_IN_LATENESSES = 8.0  # correction time of predicted rates, in latenesses
_CORRECTED_IN_LAGS = 2.0
"""Correction time at second order, in acceleration lags: measured rates are noisier than the model is wrong."""
_TURN_PART_OF_LAGGING = 0.05  # `_TURN_PART` of a response of second order
_SCALE_1_S = 0.25
MIN_SCALE, MAX_SCALE = 0.5, 1.8


class SentCommand(NamedTuple):
    """A command: time of effect, body rates, rad/s, and lift, m/s²."""

    acts_us: int
    values: tuple[float, float, float, float]


class Predictor:
    """Predicts one vehicle.

    Attributes:
        corrected_in_s: Time constant of corrections. Grows with the delay, else jitter and loss look like motion.
        disturbance: Acceleration, ENU, m/s², and angular acceleration, FLU, rad/s², (6,).
        drift_m_s: Velocity of the estimated position minus estimated velocity, ENU.
    """

    def __init__(self, vehicle: Vehicle, response: Response) -> None:
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self.thrust_scale = 1.0
        self.corrected_in_s = 0.0
        self.adopt(vehicle, response)
        self.begin()
        carry(np.ones(STATES), np.ones(1), np.zeros((1, COMMANDS)), self.disturbance, self._model)

    def adopt(self, vehicle: Vehicle, response: Response) -> None:
        self._model = packed(response_model(vehicle, response))
        late_s = _CORRECTED_IN_LATENESSES * max(delay_s(response) - _AS_TUNED_S, 0.0)
        behind_s = np.array(response.acceleration_lag_s)
        self._late_s = np.maximum(late_s, _CORRECTED_IN_LAGS * behind_s)
        parts = _TURN_PART * slowness(response) ** -_TURN_POWER
        self._turn_part = np.where(behind_s > 0.0, _TURN_PART_OF_LAGGING, parts)

    def begin(self) -> None:
        """Reset to level hover without disturbance."""
        self._sent = deque([SentCommand(-(2**62), (0.0, 0.0, 0.0, self._gravity_m_s2))])
        self._known: tuple[int, Array] | None = None
        self.disturbance, self.drift_m_s = np.zeros(6), np.zeros(3)
        self.learns = False

    def sent(self, acts_us: int, rate: Vector, lift_m_s2: float) -> None:
        while self._sent and self._sent[-1].acts_us >= acts_us:
            self._sent.pop()
        self._sent.append(SentCommand(acts_us, (*rate, lift_m_s2)))
        while len(self._sent) > 1 and self._sent[1].acts_us < acts_us - _KEPT_US:
            self._sent.popleft()

    def observe(self, at_us: int, state: StateFrame) -> None:
        """Use a state; one out of order is dropped."""
        if self._known is not None and at_us <= self._known[0]:
            return
        lift = self._acting(at_us)[0].values[3]
        values = (*state.position_enu_m, *state.velocity_enu_m_s, *state.attitude, *state.rate_flu_rad_s, lift)
        y = np.array((*values, 0.0, 0.0, 0.0))
        known = self._known
        if known is None or at_us - known[0] > _FOLLOWS_US:
            self.disturbance, self.drift_m_s = np.zeros(6), np.zeros(3)
        else:
            expected = self._carried(known[1], known[0], at_us)
            y[LIFT], y[ACCELERATION] = expected[LIFT], expected[ACCELERATION]
            y = self._corrected(expected, y, (at_us - known[0]) * 1e-6)
        self._known = (at_us, y)

    def at(self, time_us: int) -> Array:
        """Return position, velocity (with drift), attitude, rates, lift and rate acceleration, (17,)."""
        if self._known is None:
            raise ValueError("no state is known")
        at_us, y = self._known
        there = self._carried(y, at_us, time_us) if time_us > at_us else y.copy()
        there[VELOCITY] += self.drift_m_s
        return there

    def _corrected(self, expected: Array, measured: Array, passed_s: float) -> Array:
        parts = np.full(STATES, self._part(passed_s, 0.0))
        parts[RATE] = [self._part(passed_s, late_s) for late_s in self._late_s.tolist()]
        if float(expected[ATTITUDE] @ measured[ATTITUDE]) < 0.0:
            measured[ATTITUDE] *= -1.0
        missed = parts * (measured - expected)
        y: Array = expected + missed
        y[ATTITUDE] /= np.linalg.norm(y[ATTITUDE])
        part = 1.0 - exp(-_DRIFT_1_S * passed_s)
        drift = self.drift_m_s + part * missed[POSITION] / passed_s
        self.drift_m_s = np.clip(drift, -_MAX_DRIFT_M_S, _MAX_DRIFT_M_S)
        self._learn(y, np.concatenate((missed[VELOCITY], self._turn_part * missed[RATE])), passed_s)
        return y

    def _part(self, passed_s: float, late_s: float) -> float:
        corrected_in_s = self.corrected_in_s + late_s
        return 1.0 - exp(-passed_s / corrected_in_s) if corrected_in_s > 0.0 else 1.0

    def _learn(self, y: Array, missed: Array, passed_s: float) -> None:
        part = 1.0 - exp(-_DISTURBANCE_1_S * passed_s)
        change = part * missed / passed_s
        self.disturbance = np.clip(self.disturbance + change, -_MAX_DISTURBANCE, _MAX_DISTURBANCE)
        if not self.learns:
            return
        up = np.array(rotations.rotation_matrix(tuple(y[ATTITUDE].tolist())))[:, 2]
        along = float(up @ self.disturbance[:3]) / max(float(y[LIFT]), 1.0)
        step = _SCALE_1_S * passed_s * along
        self.thrust_scale = min(max(self.thrust_scale * (1.0 + step), MIN_SCALE), MAX_SCALE)

    def _carried(self, y: Array, from_us: int, until_us: int) -> Array:
        acting = self._acting(from_us, until_us)
        begins = np.array([from_us, *(it.acts_us for it in acting[1:]), until_us])
        commands = np.array([it.values for it in acting])
        there = carry(y, np.diff(begins) * 1e-6, commands, self.disturbance, self._model)
        there[POSITION] += (until_us - from_us) * 1e-6 * self.drift_m_s
        return there

    def _acting(self, from_us: int, until_us: int = 0) -> list[SentCommand]:
        acting = [self._sent[0]]
        for it in self._sent:
            if it.acts_us <= from_us:
                acting = [it]
            elif it.acts_us < until_us:
                acting.append(it)
        return acting
