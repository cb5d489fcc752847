"""Identification of the body-rate response: a lag fitted to the simulated rates, which follow the commands alone."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from msgspec.structs import replace
from scipy.optimize import minimize
from scipy.signal import lfilter

from colibri.common.types import Array
from colibri.companion.guide import Companion
from colibri.companion.stack import CompanionError, Response, response_text

_GRID_S = 0.002
MAX_LATENCY_S = 0.12
_LATENCIES = round(MAX_LATENCY_S / _GRID_S)
_NEAR = 6  # latencies refined on either side of the table's best
_TIME_CONSTANTS_S = np.geomspace(0.008, 0.5, 36)
_ACCELERATION_LAGS_S = np.geomspace(0.008, 0.15, 10)
_LEAST_LAG_S = 0.004  # a shorter lag of the acceleration counts as zero
_CLEARLY_LESS = 0.9  # largest ratio of unexplained variances that justifies the second order
_LEAST_SAMPLES = 200
MIN_EXPLAINED = 0.5


class RateLog(NamedTuple):
    """Commands by arrival at the vehicle, and measurements; body rates, rad/s, (k, 3)."""

    command_s: Array
    commands: Array
    measured_s: Array
    rates: Array


class Fit(NamedTuple):
    """A fitted lag of p, q, r, with explained parts of variances, and body rates, rad/s, (k, 3)."""

    time_constant_s: Array
    acceleration_lag_s: Array
    latency_s: float
    explained: Array
    grid_s: Array
    modelled: Array
    measured: Array

    @property
    def order(self) -> int:
        return 2 if self.acceleration_lag_s.any() else 1


def fit(log: RateLog) -> Fit:
    """Fit the best lag to a log, or raise `CompanionError`."""
    if min(len(log.command_s), len(log.measured_s)) < _LEAST_SAMPLES:
        raise CompanionError(f"identification: only {len(log.measured_s)} states came while the steps were flown")
    grid = np.arange(max(log.command_s[0], log.measured_s[0]), log.measured_s[-1], _GRID_S)
    commands = log.commands[np.maximum(np.searchsorted(log.command_s, grid, side="right") - 1, 0)]
    measured = np.stack([np.interp(grid, log.measured_s, log.rates[:, axis]) for axis in range(3)], axis=1)
    found = _found(commands, measured, np.zeros(1))
    second = _found(commands, measured, _ACCELERATION_LAGS_S)
    if second.unexplained.sum() < _CLEARLY_LESS * found.unexplained.sum():
        found = second
    explained = 1.0 - found.unexplained
    if explained.min() < MIN_EXPLAINED:
        axis = "pqr"[int(explained.argmin())]
        raise CompanionError(
            f"identification: a lag explains {100.0 * max(explained.min(), 0.0):.0f} % of the rate {axis}, "
            f"less than {100 * MIN_EXPLAINED:.0f}: fly it again, in less wind"
        )
    lags, compared = np.where(found.lags_s < _LEAST_LAG_S, 0.0, found.lags_s), measured[_LATENCIES:]
    modelled = np.stack([_late(_lagged(commands[:, axis], *lags[axis]), found.late) for axis in range(3)], axis=1)
    modelled += (compared - modelled).mean(axis=0)
    return Fit(lags[:, 0], lags[:, 1], found.late * _GRID_S, explained, grid[_LATENCIES:], modelled, compared)


class _Found(NamedTuple):
    """Lags of the axes, (3, 2), latency in samples, unexplained part of each variance, (3,)."""

    lags_s: Array
    late: int
    unexplained: Array


def _found(commands: Array, measured: Array, acceleration_lags_s: Array) -> _Found:
    table = [(lag_s, behind_s) for lag_s in _TIME_CONSTANTS_S for behind_s in acceleration_lags_s]
    left = np.array([[_unexplained(commands, measured, axis, lags) for lags in table] for axis in range(3)])
    best = int(left.min(axis=1).sum(axis=0).argmin())
    near = range(max(best - _NEAR, 0), min(best + _NEAR + 1, _LATENCIES))
    closely = []
    for late in near:
        axes = [_refined(commands, measured, axis, late, table[int(left[axis, :, late].argmin())]) for axis in range(3)]
        closely.append(_Found(np.array([lags for lags, _ in axes]), late, np.array([rest for _, rest in axes])))
    return min(closely, key=lambda one: float(one.unexplained.sum()))


def _unexplained(commands: Array, measured: Array, axis: int, lags_s: tuple[float, float]) -> Array:
    """Return the unexplained part of the variance at each latency: var(a - b) = var(a) + var(b) - 2 cov(a, b)."""
    modelled, compared = _lagged(commands[:, axis], *lags_s), measured[_LATENCIES:, axis]
    compared, count = compared - compared.mean(), len(compared)
    sums = np.cumsum([np.append(0.0, modelled), np.append(0.0, modelled**2)], axis=1)
    means, squares = (sums[:, count:] - sums[:, :-count]) / count
    left: Array = squares - means**2 + compared.var() - 2.0 / count * np.correlate(modelled, compared)
    return left[:0:-1] / max(float(compared.var()), 1e-12)


def _refined(
    commands: Array, measured: Array, axis: int, late: int, near_s: tuple[float, float]
) -> tuple[tuple[float, float], float]:
    compared = measured[_LATENCIES:, axis]
    is_second = near_s[1] > 0.0

    def lags(logarithms: Array) -> tuple[float, float]:
        lag_s, behind_s = np.exp(logarithms[0]), np.exp(logarithms[-1]) if is_second else 0.0
        return float(lag_s), float(behind_s)

    def left(logarithms: Array) -> float:
        return float((compared - _late(_lagged(commands[:, axis], *lags(logarithms)), late)).var())

    begin = np.log(near_s if is_second else near_s[:1])
    found = minimize(left, begin, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-12, "maxiter": 60})
    return lags(found.x), float(found.fun) / max(float(compared.var()), 1e-12)


def _late(rates: Array, late: int) -> Array:
    return rates[_LATENCIES - late : len(rates) - late]


def _lagged(commands: Array, lag_s: float, behind_s: float) -> Array:
    if behind_s == 0.0:
        stays = float(np.exp(-_GRID_S / lag_s))
        b, a = np.array([0.0, 1.0 - stays]), np.array([1.0, -stays])
    else:
        b, a = _second_order(lag_s, behind_s)
    at_rest = np.cumsum((b - a)[:0:-1])[::-1]
    rates: Array = lfilter(b, a, commands, zi=at_rest * commands[0])[0]
    return rates


def _second_order(lag_s: float, behind_s: float) -> tuple[Array, Array]:
    """Return the discrete filter of T L w'' + T w' + w = c, with c held between samples."""
    root = np.sqrt(complex(1.0 - 4.0 * behind_s / lag_s))
    if abs(root) < 1e-4:
        root = complex(1e-4)
    fast, slow = ((-1.0 - sign * root) / (2.0 * behind_s) for sign in (1.0, -1.0))
    u, v = np.exp(fast * _GRID_S), np.exp(slow * _GRID_S)
    first = (1.0 + (slow * u - fast * v) / (fast - slow)).real
    last = (u * v + (slow * v - fast * u) / (fast - slow)).real
    return np.array([0.0, first, last]), np.array([1.0, -(u + v).real, (u * v).real])


def draw(fit: Fit, path: Path) -> None:
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    t = fit.grid_s - fit.grid_s[0]
    for axis, (name, plot) in enumerate(zip("pqr", figure.subplots(3, 1, sharex=True), strict=True)):
        plot.plot(t, fit.measured[:, axis], label="measured", linewidth=1.0)
        plot.plot(t, fit.modelled[:, axis], label=f"lag of order {fit.order}", linewidth=1.0)
        lag_ms, explained = 1e3 * fit.time_constant_s[axis], 100.0 * fit.explained[axis]
        plot.set_title(f"{name}: {lag_ms:.0f} ms, after {1e3 * fit.latency_s:.0f} ms; {explained:.0f} % explained")
        plot.set_ylabel("rad/s")
        plot.grid(alpha=0.3)
    figure.axes[0].legend(loc="upper right")
    figure.axes[-1].set_xlabel("s")
    figure.savefig(path, dpi=110)


def identified(companion: Companion) -> tuple[Response, str, Fit]:
    """Return the response, the text of its file, and its fit."""
    stack, steps = companion.peer.stack, companion.steps
    assert stack is not None, "it has flown"
    assert steps is not None, "it was an identification"
    commanded, measured = (np.reshape(rows, (-1, 4)) for rows in (steps.commanded, steps.measured))
    found = fit(RateLog(commanded[:, 0], commanded[:, 1:], measured[:, 0], measured[:, 1:]))
    p, q, r = found.time_constant_s.tolist()
    response = replace(stack.response, time_constant_s=(p, q, r), latency_s=found.latency_s)
    if found.order > 1:
        response = _of_second_order(response, found)
    explained = ", ".join(f"{100.0 * part:.0f}" for part in found.explained)
    remarks = [
        f"Identified in flight on {stack.name}: a lag of order {found.order} of the body rates p, q, r.",
        f"It explains {explained} % of their variance. For colibri companion --response.",
    ]
    return response, response_text(response, companion.thrust_scale, remarks), found


def _of_second_order(response: Response, found: Fit) -> Response:
    """Add the lags, and raise the limits to the rate loop's largest demand: a law built for less would brake late."""
    p, q, r = found.acceleration_lag_s.tolist()
    largest = (response.max_acceleration_rad_s2, response.max_rate_rad_s, response.time_constant_s)
    most_p, most_q, most_r = (
        max(assumed, rate / lag_s) if behind_s > 0.0 else assumed
        for assumed, rate, lag_s, behind_s in zip(*largest, (p, q, r), strict=True)
    )
    return replace(response, acceleration_lag_s=(p, q, r), max_acceleration_rad_s2=(most_p, most_q, most_r))
