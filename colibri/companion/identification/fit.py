"""A first-order lag fitted to what was commanded and measured, by its output error: it is simulated, and compared.

The rates of the model follow the commands alone, never the measurements: so a law that answers the vehicle's motion
meanwhile does not spoil the fit.
"""

from typing import NamedTuple

import numpy as np

from colibri.common.types import Array
from colibri.companion.errors import CompanionError

_GRID_S = 0.002
_MAX_LATENCY_S = 0.08
_TIME_CONSTANTS_S = np.geomspace(0.008, 0.5, 60)
_LEAST_SAMPLES = 200
MIN_EXPLAINED = 0.5


class RateLog(NamedTuple):
    """What was commanded, and what was measured, by one clock.

    Attributes:
        command_s: When each command reached the vehicle, (n,).
        commands: Body rates, rad/s, (n, 3).
        measured_s: When each rate was, (m,).
        rates: rad/s, (m, 3).
    """

    command_s: Array
    commands: Array
    measured_s: Array
    rates: Array


class Fit(NamedTuple):
    """The lag that was found.

    Attributes:
        time_constant_s: Of p, q, r, (3,).
        latency_s: Of all three, beyond the way of a command.
        explained: Part of the rates' variance that the model has, (3,).
        grid_s: Times of the model's rates, (k,).
        modelled, measured: Its rates and the measured ones there, rad/s, (k, 3).
    """

    time_constant_s: Array
    latency_s: float
    explained: Array
    grid_s: Array
    modelled: Array
    measured: Array


def fit(log: RateLog) -> Fit:
    """Return the first-order lag that explains a log best.

    Raises:
        CompanionError: The log is too short, or no such lag explains half of what was measured.
    """
    if min(len(log.command_s), len(log.measured_s)) < _LEAST_SAMPLES:
        raise CompanionError(f"identification: only {len(log.measured_s)} states came while the steps were flown")
    grid = np.arange(max(log.command_s[0], log.measured_s[0]) + _MAX_LATENCY_S, log.measured_s[-1], _GRID_S)
    measured = np.stack([np.interp(grid, log.measured_s, log.rates[:, axis]) for axis in range(3)], axis=1)
    latencies = np.arange(0.0, _MAX_LATENCY_S, _GRID_S)
    held = [log.commands[np.searchsorted(log.command_s, grid - late_s, side="right") - 1] for late_s in latencies]
    errors = np.array([[_errors(commands, measured, lag_s) for lag_s in _TIME_CONSTANTS_S] for commands in held])
    scaled = errors / np.maximum(measured.var(axis=0), 1e-12)
    best = int(np.argmin(scaled.min(axis=1).sum(axis=1)))
    lags = np.array([_refined(held[best], measured, axis, int(errors[best, :, axis].argmin())) for axis in range(3)])
    modelled = np.stack([_lagged(held[best][:, axis], float(lags[axis])) for axis in range(3)], axis=1)
    offset = (measured - modelled).mean(axis=0)
    explained = 1.0 - (measured - modelled - offset).var(axis=0) / np.maximum(measured.var(axis=0), 1e-12)
    if explained.min() < MIN_EXPLAINED:
        axis = "pqr"[int(explained.argmin())]
        raise CompanionError(
            f"identification: a first-order lag explains {100.0 * max(explained.min(), 0.0):.0f} % of the rate {axis}, "
            f"less than {100 * MIN_EXPLAINED:.0f}: fly it again, in less wind"
        )
    return Fit(lags, float(latencies[best]), explained, grid, modelled + offset, measured)


def _errors(commands: Array, measured: Array, lag_s: float) -> Array:
    """Return the variance of what a lag leaves unexplained of each rate, (3,)."""
    modelled = np.stack([_lagged(commands[:, axis], lag_s) for axis in range(3)], axis=1)
    unexplained: Array = (measured - modelled).var(axis=0)
    return unexplained


def _lagged(commands: Array, lag_s: float) -> Array:
    """Return commands on the grid after a first-order lag."""
    from scipy.signal import lfilter

    stays = float(np.exp(-_GRID_S / lag_s))
    rates: Array = lfilter([0.0, 1.0 - stays], [1.0, -stays], commands, zi=[stays * commands[0]])[0]
    return rates


def _refined(commands: Array, measured: Array, axis: int, near: int) -> float:
    """Return the time constant of the least error near one of the table."""
    lags = _TIME_CONSTANTS_S
    for _ in range(3):
        low, high = lags[max(near - 1, 0)], lags[min(near + 1, len(lags) - 1)]
        lags = np.geomspace(low, high, 9)
        wrong = [(measured[:, axis] - _lagged(commands[:, axis], float(lag_s))).var() for lag_s in lags]
        near = int(np.argmin(wrong))
    return float(lags[near])
