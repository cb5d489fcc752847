"""Predict the state at a command's time of effect from the last state and the commands since.

The error of a prediction is a disturbance. Its lasting part along the thrust refines the thrust scale; a lasting error
of position is a drift of the estimate.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from colibri.common.jit import packed
from colibri.common.kernels import exp
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array, Vector
from colibri.companion.stack import Response
from colibri.companion.steering import response as model
from colibri.companion.steering.response import lateness_s, slowness
from colibri.mavlink.client.states import TimedState
from colibri.plant.vehicle.description import Vehicle

_FOLLOWS_US = 150_000
"""A longer gap resets the disturbances."""
_KEPT_US = 1_000_000
_DRIFT_1_S = 8.0
"""PX4 spreads each GPS correction over a quarter of a second."""
_MAX_DRIFT_M_S = 1.0
_DISTURBANCE_1_S = 6.0
_MAX_DISTURBANCE = np.array([6.0, 6.0, 6.0, 20.0, 20.0, 20.0])
_TURN_PART = 0.5
"""Part of the rate error that counts as disturbance."""
_TURN_POWER = 8.0
"""The later the rates follow, the more of their error is the model's."""
_CORRECTED_IN_LATENESSES = 8.0
"""Correction time of predicted rates, in latenesses."""
_CORRECTED_IN_LAGS = 2.0
"""Correction time at second order, in acceleration lags: measured rates are noisier than the model is wrong."""
_TURN_PART_OF_LAGGING = 0.05
"""`_TURN_PART` of a response of second order."""
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
        model.carry(np.ones(model.STATES), np.ones(1), np.zeros((1, model.COMMANDS)), self.disturbance, self._model)

    def adopt(self, vehicle: Vehicle, response: Response) -> None:
        self._model = packed(model.response_model(vehicle, response))
        late_s = _CORRECTED_IN_LATENESSES * lateness_s(response)
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

    def observe(self, at_us: int, state: TimedState) -> None:
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
            y[model.LIFT], y[model.ACCELERATION] = expected[model.LIFT], expected[model.ACCELERATION]
            y = self._corrected(expected, y, (at_us - known[0]) * 1e-6)
        self._known = (at_us, y)

    def at(self, time_us: int) -> Array:
        """Return position, velocity (with drift), attitude, rates, lift and rate acceleration, (17,)."""
        if self._known is None:
            raise ValueError("no state is known")
        at_us, y = self._known
        there = self._carried(y, at_us, time_us) if time_us > at_us else y.copy()
        there[model.VELOCITY] += self.drift_m_s
        return there

    def _corrected(self, expected: Array, measured: Array, passed_s: float) -> Array:
        parts = np.full(model.STATES, self._part(passed_s, 0.0))
        parts[model.RATE] = [self._part(passed_s, late_s) for late_s in self._late_s.tolist()]
        if float(expected[model.ATTITUDE] @ measured[model.ATTITUDE]) < 0.0:
            measured[model.ATTITUDE] *= -1.0
        missed = parts * (measured - expected)
        y: Array = expected + missed
        y[model.ATTITUDE] /= np.linalg.norm(y[model.ATTITUDE])
        part = 1.0 - exp(-_DRIFT_1_S * passed_s)
        drift = self.drift_m_s + part * missed[model.POSITION] / passed_s
        self.drift_m_s = np.clip(drift, -_MAX_DRIFT_M_S, _MAX_DRIFT_M_S)
        self._learn(y, np.concatenate((missed[model.VELOCITY], self._turn_part * missed[model.RATE])), passed_s)
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
        up = np.array(rotation_matrix(tuple(y[model.ATTITUDE].tolist())))[:, 2]
        along = float(up @ self.disturbance[:3]) / max(float(y[model.LIFT]), 1.0)
        step = _SCALE_1_S * passed_s * along
        self.thrust_scale = min(max(self.thrust_scale * (1.0 + step), MIN_SCALE), MAX_SCALE)

    def _carried(self, y: Array, from_us: int, until_us: int) -> Array:
        acting = self._acting(from_us, until_us)
        begins = np.array([from_us, *(it.acts_us for it in acting[1:]), until_us])
        commands = np.array([it.values for it in acting])
        there = model.carry(y, np.diff(begins) * 1e-6, commands, self.disturbance, self._model)
        there[model.POSITION] += (until_us - from_us) * 1e-6 * self.drift_m_s
        return there

    def _acting(self, from_us: int, until_us: int = 0) -> list[SentCommand]:
        acting = [self._sent[0]]
        for it in self._sent:
            if it.acts_us <= from_us:
                acting = [it]
            elif it.acts_us < until_us:
                acting.append(it)
        return acting
