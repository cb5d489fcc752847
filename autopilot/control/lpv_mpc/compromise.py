"""What references beyond the largest thrust become: the least error over the preview, as compiled kernels.

A point mass, whose thrust may point anywhere, plans the deviation from the references. Its acceleration is a cubic
spline, so that attitudes, rates and moments change without jumps. References within the largest thrust stay as given
while the vehicle is near them. The QP

    min ½ Σ ‖δp‖² + w_v ‖δv‖² + w_c ‖c_{k-1} - 2 c_k + c_{k+1}‖²   subject to   ‖thrust‖ <= most at each knot

is solved by ADMM: Boyd et al., Foundations and Trends in Machine Learning 3, 2011.
"""

from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.jit import Packed, compiled
from colibri.common.matrices import inverse, matmul, norm, put
from colibri.common.types import Array

PIECES, STRIDE = 28, 8  # pieces of the spline, and control samples of each
SAMPLES = PIECES * STRIDE + 1  # of the references

# Powers of a piece of a cubic B-spline, by its four coefficients.
_POWERS = np.array([[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]) / 6.0
_FIXED = 5  # what a plan starts from: position, velocity, three coefficients
_VELOCITY, _BEND = 0.04, 5e-4  # weights; that of the position is 1 for each second
_LAST, _LAST_VELOCITY = 5.0, 0.5  # of the last knot, added, in parts of a piece
_PENALTY, _ITERATIONS, _BEGINNINGS = 1e-4, 20, 10  # of ADMM; of iterations for a plan that begins anew
_SPARED, _SPARED_AT_MOST = 0.5, 0.1  # part of the thrust left for moments: of the references' excess, and at most
_ASTRAY_M = 0.3  # a vehicle farther from its plan is where the next one begins
_SMALL = (1e-3, 1e-2, 0.05)  # m, m/s, m/s²: a smaller deviation ends
_STEADY_S = 0.5  # a disturbance is expected to last, except drag
_STILL_M2_S2 = 4.0  # slower, squared, no force is told from drag


class Compromise(NamedTuple):
    """Constants of the plans."""

    solution: Array  # (PIECES, PIECES)
    pull: Array  # gradient by position, velocity and three coefficients, (PIECES, 5)
    interval_s: float  # control sample


class Deviation(NamedTuple):
    """Deviation from references at a control sample."""

    phase: int  # samples since the first piece began
    motion: Array  # position, m, and velocity, m/s, where it began, ENU, (2, 3)
    coefficients: Array  # of acceleration, m/s², ENU, (PIECES + 3, 3)
    dual: Array  # of ADMM, (PIECES, 3)

    @staticmethod
    def none() -> "Deviation":
        return Deviation(-1, np.zeros((2, 3)), np.zeros((PIECES + 3, 3)), np.zeros((PIECES, 3)))


@lru_cache(maxsize=4)
def compromise(interval_s: float) -> Compromise:
    d, columns = STRIDE * interval_s, PIECES + _FIXED
    P, V, A = (np.zeros((PIECES, columns)) for _ in range(3))
    unit = np.eye(columns)
    p, v = unit[0], unit[1]
    for i in range(PIECES):
        a = matmul(_POWERS, unit[2 + i : 6 + i])
        p = p + d * v + d * d * (a[0] / 2.0 + a[1] / 6.0 + a[2] / 12.0 + a[3] / 20.0)
        v = v + d * (a[0] + a[1] / 2.0 + a[2] / 3.0 + a[3] / 4.0)
        P[i], V[i], A[i] = p, v, (unit[3 + i] + 4.0 * unit[4 + i] + unit[5 + i]) / 6.0
    place, speed = np.full(PIECES, d), np.full(PIECES, d * _VELOCITY)
    place[-1], speed[-1] = place[-1] + d * _LAST, speed[-1] + d * _LAST_VELOCITY
    bend = np.diff(unit[2:], 2, axis=0)
    H = matmul(P.T * place, P) + matmul(V.T * speed, V) + _BEND * matmul(bend.T.copy(), bend)
    free = slice(_FIXED, None)
    solution = inverse((H + _PENALTY * matmul(A.T.copy(), A))[free, free].copy())
    return Compromise(solution, H[free, :_FIXED].copy(), interval_s)


@compiled
def stay_within(
    now: Packed,
    position: Array,  # ENU, (SAMPLES, 3) or more rows, as below
    velocity: Array,
    acceleration: Array,
    packed: Packed,  # a `Compromise`
    vehicle: Packed,
    phase: int,  # of the deviation before, and its arrays, which are written; < 0 without one
    motion: Array,
    coefficients: Array,
    dual: Array,
    out: tuple[Array, Array, Array],  # position, velocity and acceleration that can be followed, ENU, (n, 3)
) -> int:
    """Write references within the largest thrust; return the phase of their deviation, or -1 without one."""
    rigid, law = now[0].rigid, packed[0]
    d = STRIDE * law.interval_s
    place, speed, changed = np.empty(3), np.empty(3), np.empty(3)
    if phase < 0:
        motion[:, :], coefficients[:, :], dual[:, :] = 0.0, 0.0, 0.0
    elif phase + 1 == STRIDE:
        _evaluate(motion, coefficients, 1.0, d, motion[0], motion[1], changed)
        for k in range(PIECES + 2):
            put(coefficients[k + 1], coefficients[k])
        for k in range(PIECES - 1):
            put(dual[k + 1], dual[k])
    phase = (phase + 1) % STRIDE
    _evaluate(motion, coefficients, phase / STRIDE, d, place, speed, changed)
    for i in range(3):
        changed[i] = rigid[i] - position[0, i] - place[i]
    astray = norm(changed) > _ASTRAY_M
    if phase == 0 or astray:
        needed = np.empty((PIECES, 3))
        excess, most = _needed(now, velocity, acceleration, law.interval_s, vehicle, needed)
        gravity_m_s2 = vehicle[0].airframe.gravity_m_s2
        if astray:
            coefficients[:, :], phase = 0.0, 0
            for i in range(3):
                motion[0, i], motion[1, i] = rigid[i] - position[0, i], rigid[3 + i] - velocity[0, i]
            _begin(now, needed[0], vehicle, d, coefficients)
            for _ in range(_BEGINNINGS):
                _plan(motion, coefficients, dual, needed, most, gravity_m_s2, law)
        ends = excess <= 0.0 and norm(motion[0]) < _SMALL[0] and norm(motion[1]) < _SMALL[1]
        for k in range(PIECES + 3):
            ends = ends and norm(coefficients[k]) < _SMALL[2]
        if ends:
            phase = -1
        else:
            _plan(motion, coefficients, dual, needed, most, gravity_m_s2, law)
    start = motion.copy()
    for n in range(out[0].shape[0]):
        if phase < 0:
            place[:], speed[:], changed[:] = 0.0, 0.0, 0.0
        else:
            piece, sample = divmod(phase + n, STRIDE)
            if sample == 0 and n > 0:
                _evaluate(start, coefficients[piece - 1 :], 1.0, d, start[0], start[1], changed)
            _evaluate(start, coefficients[piece:], sample / STRIDE, d, place, speed, changed)
        for i in range(3):
            out[0][n, i] = position[n, i] + place[i]
            out[1][n, i] = velocity[n, i] + speed[i]
            out[2][n, i] = acceleration[n, i] + changed[i]
    return phase


@compiled
def _needed(
    now: Packed, velocity: Array, acceleration: Array, interval_s: float, vehicle: Packed, needed: Array
) -> tuple[float, float]:
    """Write the thrust of the references at each knot, m/s², (PIECES, 3); return its excess, in parts, and the limit.

    The part of the disturbance against the velocity is drag: it turns with the references.
    """
    rigid, airframe, disturbance = now[0].rigid, vehicle[0].airframe, now[0].disturbance.acceleration
    squared, against = _STILL_M2_S2, 0.0
    for i in range(3):
        squared += rigid[3 + i] * rigid[3 + i]
        against -= rigid[3 + i] * disturbance[i]
    unknown = max(against / squared, 0.0)
    hover_n = airframe.mass_kg * airframe.gravity_m_s2
    drag = unknown + (airframe.drag_xy + airframe.rotor_drag * sqrt(hover_n)) / airframe.mass_kg
    most, worst = now[0].force.max_n / airframe.mass_kg, 0.0
    for k in range(PIECES):
        at = STRIDE * (k + 1)
        lasting = max(1.0 - at * interval_s / _STEADY_S, 0.0)
        for i in range(3):
            steady = disturbance[i] + unknown * rigid[3 + i]
            needed[k, i] = acceleration[at, i] + drag * velocity[at, i] - lasting * steady
        needed[k, 2] += airframe.gravity_m_s2
        worst = max(worst, norm(needed[k]))
    excess = worst / most - 1.0
    return excess, most * (1.0 - min(_SPARED * max(excess, 0.0), _SPARED_AT_MOST))


@compiled
def _begin(now: Packed, needed: Array, vehicle: Packed, d: float, coefficients: Array) -> None:
    """Write the first coefficients of a plan from the vehicle's thrust and its turn."""
    rigid, model = now[0].rigid, vehicle[0]
    R, flown = rotation_matrix((rigid[6], rigid[7], rigid[8], rigid[9])), 0.0
    for j in range(model.allocation.shape[1]):
        flown += model.allocation[0, j] * now[0].squared[j] / model.airframe.mass_kg
    for i in range(3):
        turn = d * flown * (R[i][0] * rigid[11] - R[i][1] * rigid[10])
        for k in range(3):
            coefficients[k, i] = flown * R[i][2] - needed[i] + (k - 1) * turn


@compiled
def _plan(
    motion: Array, coefficients: Array, dual: Array, needed: Array, most: float, gravity_m_s2: float, law: Compromise
) -> None:
    """Write the free coefficients, all but the first three. A far vehicle heads for a place as far as it can brake."""
    reach_m = 0.25 * max(most - gravity_m_s2, 0.2 * gravity_m_s2) * (PIECES * STRIDE * law.interval_s) ** 2
    part = min(reach_m / max(norm(motion[0]), 1e-9), 1.0)
    c, gradient, target = coefficients, np.empty((PIECES, 3)), np.empty((PIECES, 3))
    for k in range(PIECES):
        for i in range(3):
            gradient[k, i] = law.pull[k, 0] * part * motion[0, i] + law.pull[k, 1] * motion[1, i]
            for j in range(3):
                gradient[k, i] += law.pull[k, 2 + j] * c[j, i]
    for _ in range(_ITERATIONS):
        for k in range(PIECES):
            for i in range(3):
                target[k, i] = needed[k, i] + (c[k + 1, i] + 4.0 * c[k + 2, i] + c[k + 3, i]) / 6.0 + dual[k, i]
            within = most / max(norm(target[k]), most)
            for i in range(3):
                dual[k, i] = (1.0 - within) * target[k, i]
                target[k, i] = within * target[k, i] - dual[k, i] - needed[k, i]
        for i in range(3):
            target[0, i] -= (c[1, i] + 4.0 * c[2, i]) / 6.0
            target[1, i] -= c[2, i] / 6.0
        for k in range(PIECES):
            for i in range(3):
                total = target[k, i]
                if k + 1 < PIECES:
                    total += 4.0 * target[k + 1, i]
                if k + 2 < PIECES:
                    total += target[k + 2, i]
                target[k, i] = _PENALTY * total / 6.0 - gradient[k, i]
        for k in range(PIECES):
            x, y, z = 0.0, 0.0, 0.0
            for j in range(PIECES):
                share = law.solution[k, j]
                x, y, z = x + share * target[j, 0], y + share * target[j, 1], z + share * target[j, 2]
            c[3 + k, 0], c[3 + k, 1], c[3 + k, 2] = x, y, z


@compiled
def _evaluate(
    motion: Array, coefficients: Array, s: float, d: float, place: Array, speed: Array, acceleration: Array
) -> None:
    """Write the deviation at part s of a piece of d seconds that begins with a motion."""
    t = s * d
    for i in range(3):
        c0, c1, c2, c3 = coefficients[0, i], coefficients[1, i], coefficients[2, i], coefficients[3, i]
        a0, a1, a2 = (c0 + 4.0 * c1 + c2) / 6.0, 0.5 * (c2 - c0), 0.5 * (c0 - 2.0 * c1 + c2)
        a3, v = (c3 - c0 + 3.0 * (c1 - c2)) / 6.0, motion[1, i]
        place[i] = motion[0, i] + t * (v + t * (a0 / 2.0 + s * (a1 / 6.0 + s * (a2 / 12.0 + s * a3 / 20.0))))
        speed[i] = v + t * (a0 + s * (a1 / 2.0 + s * (a2 / 3.0 + s * a3 / 4.0)))
        acceleration[i] = a0 + s * (a1 + s * (a2 + s * a3))
