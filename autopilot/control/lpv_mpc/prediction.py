"""The attitude over a horizon: an LPV model with exact kinematics and rotor lag, as compiled kernels.

The thesis's model [3.3] equates Euler rates and body rates, which couples yaw into pitch at a large tilt. Here body
rates are states, A has T(phi, theta) of [2.7], and moments lag. State, 9:

    [phi p theta q psi r M1 M2 M3]        rad, rad/s, N m

Scheduling along the previous plan: Cisneros, Voss and Werner, CDC 2016.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.common.jit import compiled
from colibri.common.kernels import cos, sin
from colibri.common.types import Array

Integers: TypeAlias = NDArray[np.int64]

PHI, P, THETA, Q, PSI, R, M1, M2, M3 = range(9)
STATES = 9
INPUTS = 3
ANGLES = (PHI, THETA, PSI)
RATES = (P, Q, R)
SCHEDULE = (PHI, THETA, P, Q, R)  # the scheduling states, in the column order of a schedule

_TAYLOR_TERMS = 4  # remainder (h / lag)⁵ / 120: 3e-5 of the moment's effect at 8 ms and a lag of 25 ms
_MIN_COSINE = 0.1  # of pitch: valid up to 84 degrees


class Body(NamedTuple):
    """Parameters of the model."""

    ix: float  # kg m²
    iy: float  # kg m²
    iz: float  # kg m²
    lag_1_s: float  # rate of the moments towards their commands; 0: immediate


class InitialState(NamedTuple):
    """Start of a prediction."""

    x: Array  # state, (9,)
    u: Array  # moments last commanded, N m, (3,)
    disturbance_n_m: Array  # constant over the horizon, (3,)
    momentum: float  # h of the rotors along body z, N m s
    max_speed: float  # available, in parts of the vehicle's largest


@compiled
def flow(schedule: Array, momentum: float, body: Body, X: Array, out: Array) -> None:
    """Write A(schedule) X, (9, k), for one row of the schedule, (5,)."""
    phi, theta, p, q, r = schedule
    s, c = sin(phi), cos(phi)
    cosine = max(cos(theta), _MIN_COSINE)
    t = sin(theta) / cosine
    px = 0.5 * (body.iy - body.iz) / body.ix
    py = 0.5 * (body.iz - body.ix) / body.iy
    pz = 0.5 * (body.ix - body.iy) / body.iz
    for k in range(X.shape[1]):
        xp, xq, xr = X[P, k], X[Q, k], X[R, k]
        out[PHI, k] = xp + s * t * xq + c * t * xr
        out[THETA, k] = c * xq - s * xr
        out[PSI, k] = (s * xq + c * xr) / cosine
        out[P, k] = (px * r - momentum / body.ix) * xq + px * q * xr + X[M1, k] / body.ix
        out[Q, k] = (py * r + momentum / body.iy) * xp + py * p * xr + X[M2, k] / body.iy
        out[R, k] = pz * q * xp + pz * p * xq + X[M3, k] / body.iz
        out[M1, k] = -body.lag_1_s * X[M1, k]
        out[M2, k] = -body.lag_1_s * X[M2, k]
        out[M3, k] = -body.lag_1_s * X[M3, k]


@compiled
def respond(
    now: InitialState, schedule: Array, body: Body, starts: Integers, interval_s: float, responses: Array
) -> None:
    """Predict: column 0 without increments, column 1 + 3 j + i with a unit increment of input i at move j.

    Zero-order hold by a Taylor series of the exponential. `starts` are the moves' steps, (b,), `responses` (N + 1, 9, 1
    + 3 b).
    """
    columns = responses.shape[2]
    commanded = np.zeros((INPUTS, columns))
    commanded[:, 0] = now.u
    inertia = (body.ix, body.iy, body.iz)
    responses[0] = 0.0
    responses[0, :, 0] = now.x
    term, following = np.empty((STATES, columns)), np.empty((STATES, columns))
    move = 0
    for step in range(schedule.shape[0]):
        if move < starts.shape[0] and starts[move] == step:
            for i in range(INPUTS):
                commanded[i, 1 + INPUTS * move + i] = 1.0
            move += 1
        used = 1 + INPUTS * move
        X = responses[step]
        if body.lag_1_s == 0.0:
            X[M1 : M3 + 1, :used] = commanded[:, :used]
        flow(schedule[step], now.momentum, body, X[:, :used], term[:, :used])
        for i in range(INPUTS):
            term[P + 2 * i, 0] += now.disturbance_n_m[i] / inertia[i]
            for k in range(used):
                term[M1 + i, k] += body.lag_1_s * commanded[i, k]
        after = responses[step + 1]
        after[:] = X
        for order in range(1, _TAYLOR_TERMS + 1):
            factor = interval_s / order
            for row in range(STATES):
                for k in range(used):
                    term[row, k] *= factor
                    after[row, k] += term[row, k]
            if order < _TAYLOR_TERMS:
                flow(schedule[step], now.momentum, body, term[:, :used], following[:, :used])
                term, following = following, term


@compiled
def schedule_along(x: Array, ahead: Array, schedule: Array) -> None:
    """Fill `schedule`, (N, 5), with the states in the middle of each step.

    These are means of neighbours: `x`, (9,), now, then the previous plan's, `ahead`, (n, 9), the last one repeated.
    """
    steps = schedule.shape[0]
    for step in range(steps):
        begin = x if step == 0 else ahead[min(step, ahead.shape[0]) - 1]
        end = ahead[min(step + 1, ahead.shape[0]) - 1]
        for i in range(len(SCHEDULE)):
            schedule[step, i] = 0.5 * (begin[SCHEDULE[i]] + end[SCHEDULE[i]])
