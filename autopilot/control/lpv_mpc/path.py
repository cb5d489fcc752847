"""The speed along the path as a variable of the plan, as compiled kernels.

Path time θ passes at σ seconds a second, linear within a block. For references P of path time:

    p(t) = P(θ(t)),   dp/dt = σ P',   d²p/dt² = σ² P'' + dσ/dt P',   dθ/dt = σ

The QP has σ at the end of each block as a variable.
"""

from math import floor
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from colibri.autopilot.control.interface import Horizon
from colibri.autopilot.control.lpv_mpc.cost import Integers
from colibri.autopilot.control.lpv_mpc.deviations import POSITION, VELOCITY
from colibri.autopilot.control.qp import Qp
from colibri.common.config import Positive, Table
from colibri.common.jit import compiled
from colibri.common.types import Array


class PathSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The speed along the path, relative to that of the references."""

    min_speed: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
    """1 follows the clock."""
    max_speed: Annotated[float, msgspec.Meta(ge=1.0, le=2.0)]
    """To catch up with the clock."""
    reward: Positive
    """On path time gained, 1/s."""
    change: Positive
    """On the square of each change of a speed."""


class SpeedEffects(NamedTuple):
    """Effect of each σ at the end of a block on every sample, (N + 2, b)."""

    shares: Array  # on the speed
    passed: Array  # on path time, s


class PathLimits(NamedTuple):
    """Bounds and cost of σ."""

    lower: float
    upper: float
    reward: float  # on path time, 1/s
    change: float  # on the square of a change


class PathNow(NamedTuple):
    speeds: Array  # nominal σ, (N + 2,)
    slopes: Array  # P', P'', (N + 2, 6)
    part: float  # of the motion of the references that counts
    limits: PathLimits


def speed_effects(starts: Integers, interval_s: float) -> SpeedEffects:
    blocks, samples = len(starts) - 1, int(starts[-1]) + 2
    shares = np.zeros((samples, blocks))
    for block in range(blocks):
        begin, end = int(starts[block]), int(starts[block + 1])
        for step in range(begin, end + 1):
            shares[step, block] = (step - begin) / (end - begin)
            if block > 0:
                shares[step, block - 1] = (end - step) / (end - begin)
    shares[-1] = shares[-2]
    passed = np.zeros_like(shares)
    for step in range(1, samples):
        passed[step] = passed[step - 1] + 0.5 * interval_s * (shares[step - 1] + shares[step])
    return SpeedEffects(shares, passed)


@compiled
def carry_speeds(last: Array, starts: Integers, lower: float, upper: float, speeds: Array) -> None:
    """Fill σ at each sample, (N + 2,), from the previous plan's, (n,)."""
    speeds[0] = last[0]
    for block in range(starts.shape[0] - 1):
        begin, end = starts[block], starts[block + 1]
        first, final = speeds[begin], min(max(last[min(end, last.shape[0] - 1)], lower), upper)
        for step in range(begin + 1, end + 1):
            speeds[step] = first + (final - first) * (step - begin) / (end - begin)
    speeds[-1] = speeds[-2]


@compiled
def slide(
    references: Horizon,  # `interval_s` apart
    from_s: float,
    speeds: Array,  # σ, (n,)
    interval_s: float,
    out: tuple[Array, Array, Array, Array],  # position, velocity, acceleration, (n, 3), and yaw, (n,)
    slopes: Array,  # P', P'', (n, 6)
) -> float:
    """Fill references at path times moving at σ; return the last path time, s."""
    p, v, a, j, s, yaw, yaw_rate, yaw_acceleration = references
    passed = from_s / interval_s
    samples = speeds.shape[0]
    for n in range(samples):
        if n > 0:
            passed += 0.5 * (speeds[n - 1] + speeds[n])
        row = min(floor(passed + 0.5), yaw.shape[0] - 1)
        dt = (passed - row) * interval_s
        before, after = max(n - 1, 0), min(n + 1, samples - 1)
        change_1_s = (speeds[after] - speeds[before]) / ((after - before) * interval_s)
        for i in range(3):
            P1 = v[row, i] + dt * (a[row, i] + 0.5 * dt * (j[row, i] + dt / 3.0 * s[row, i]))
            P2 = a[row, i] + dt * (j[row, i] + 0.5 * dt * s[row, i])
            out[0][n, i] = p[row, i] + dt * (
                v[row, i] + 0.5 * dt * (a[row, i] + dt / 3.0 * (j[row, i] + 0.25 * dt * s[row, i]))
            )
            out[1][n, i] = speeds[n] * P1
            out[2][n, i] = speeds[n] * speeds[n] * P2 + change_1_s * P1
            slopes[n, i], slopes[n, 3 + i] = P1, P2
        out[3][n] = yaw[row] + dt * (yaw_rate[row] + 0.5 * dt * yaw_acceleration[row])
    return passed * interval_s


@compiled
def fill_slides(path: PathNow, effects: SpeedEffects, responses: Array) -> None:
    """Write the effect of each σ on the tracking error, the last column of each block."""
    inputs = responses.shape[2] // effects.shares.shape[1]
    for step in range(responses.shape[0]):
        for block in range(effects.shares.shape[1]):
            column = inputs * block + inputs - 1
            share, passed = path.part * effects.shares[step, block], path.part * effects.passed[step, block]
            for i in range(3):
                P1, P2 = path.slopes[step, i], path.slopes[step, 3 + i]
                responses[step, POSITION + i, column] = -passed * P1
                responses[step, VELOCITY + i, column] = -(path.speeds[step] * passed * P2 + share * P1)


@compiled
def price(path: PathNow, effects: SpeedEffects, starts: Integers, qp: Qp) -> None:
    inputs, limits = qp.f.shape[0] // (starts.shape[0] - 1), path.limits
    for block in range(starts.shape[0] - 1):
        here = inputs * block + inputs - 1
        before, after = path.speeds[starts[block]], path.speeds[starts[block + 1]]
        qp.lower[here], qp.upper[here] = limits.lower - after, limits.upper - after
        change = limits.change * (after - before)
        qp.f[here] += change - limits.reward * effects.passed[starts[-1], block]
        qp.H[here, here] += limits.change
        if block > 0:
            there = here - inputs
            qp.f[there] -= change
            qp.H[there, there] += limits.change
            qp.H[here, there] -= limits.change
            qp.H[there, here] -= limits.change


@compiled
def read_speeds(speeds: Array, shares: Array, z: Array) -> Array:
    inputs = z.shape[0] // shares.shape[1]
    planned = speeds.copy()
    for sample in range(shares.shape[0]):
        for block in range(shares.shape[1]):
            planned[sample] += shares[sample, block] * z[inputs * block + inputs - 1]
    return planned
