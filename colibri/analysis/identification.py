"""Thrust, rotor lag, inertia and drag of a vehicle by least squares, from motion and rotor commands of a flight.

Rotor speeds follow the commands, ω' = (u - ω) / τ with u² = (1 - f) c + f c² in parts of the top speed, after a delay.
Their thrusts and moments are linear in thrust over mass, moments over inertia, and drag over mass; both sides of each
equation are averaged over the same short intervals, so that no noise is differentiated. Intervals are of 95 %, from the
scatter between seconds of the flight (cluster-robust covariance).
"""

from collections.abc import Sequence
from math import exp, hypot, inf
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from colibri.analysis.recorded_motion import LogError, Motion, Series
from colibri.common.config import value_at
from colibri.common.jit import compiled
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle, VehicleError

_SETTLED_S = 1.5  # after take-off and before landing
_AVERAGED_S = 0.04
_TRAINED = 0.75  # part of the flight; the rest is held out
_WIDEST = 0.3  # relative half-width of an interval; wider: the number is kept
_CROSSED = 0.3  # largest part of the pitch moment that turns a vehicle in roll, or the other way round
_YAW_INERTIA = 0.15  # 95 % of vehicles: Iz / (Ix + Iy) is that near the first file's
_RARE = 0.1  # of inertia and torque: uncertain if commands are too rare for the lag


class Number(NamedTuple):
    key: str  # of the vehicle file; inertia_kg_m2 with its place
    before: float
    after: float
    relative: float  # half-width of the 95 % interval, of the fitted value

    @property
    def is_fitted(self) -> bool:
        return self.relative <= _WIDEST


class Identified(NamedTuple):
    numbers: list[Number]
    held_out: list[tuple[str, str, float, float]]  # quantity, unit, standard deviation and RMS error where not fitted
    flight_s: float
    curve: float | None  # f of the thrust curve, if fitted; 1: control is speed, 0: control is thrust
    delay_s: float  # from the command's time to the rotors


def identify(motion: Motion, vehicle: Vehicle) -> Identified:
    """Fit the numbers of a vehicle with lag and drag to a flight; its mass and geometry are taken as true.

    Raises:
        LogError: The log has no flight, or one of another vehicle.
    """
    flight = _flight(motion, vehicle)
    lag, lag_off = _fit_lag(flight)
    rotors = flight.shares(lag) if flight.speed is None else flight.speed
    channels = [*_body_channels(flight, rotors), *_speed_channels(flight, lag)]
    solutions = {channel.quantity: _solve(channel) for channel in channels}
    roll, pitch, *_ = channels
    yaw = solutions["yaw"]
    for mine, other in ((roll, pitch), (pitch, roll)):
        c, off, _ = _solve(mine._replace(x=np.column_stack([mine.x, other.x[:, 0]])))
        if c[0] < off[0] or abs(c[-1]) - off[-1] > _CROSSED * c[0] or yaw.c[0] < -yaw.off[0]:
            raise LogError(
                "the motion does not follow from the commands with these positions and directions of the rotors: look"
                " at --layout and --order"
            )
    held_out = []
    for quantity, unit, y, x, t_s in channels:
        held = t_s >= _TRAINED * t_s[-1]
        left = y[held] - x[held] @ solutions[quantity].c
        held_out.append((quantity, unit, float(y[held].std()), float(np.sqrt((left * left).mean()))))
    curve = lag.curve if lag_off[3] <= _WIDEST else None
    numbers = _numbers(vehicle, lag, lag_off, solutions)
    return Identified(numbers, held_out, float(flight.t_s[-1] - flight.t_s[0]), curve, lag.delay_s)


class _Lag(NamedTuple):
    """From command to rotor speed, in parts of the top speed."""

    up_s: float
    down_s: float
    delay_s: float
    curve: float


_LOW, _HIGH = _Lag(1e-3, 1e-3, -0.02, -0.5), _Lag(1.0, 1.0, 0.15, 1.5)


class _Flight(NamedTuple):
    vehicle: Vehicle
    t_s: Array  # grid, (n,)
    rate: Array
    velocity: Array  # FLU
    turn: Array  # FLU to ENU, (n, 3, 3)
    force: Array  # specific, at the middle of each interval, (n - 1, 3)
    command: Series
    speed: Array | None  # measured, in parts of the first file's top speed

    @property
    def dt_s(self) -> float:
        return float(self.t_s[1] - self.t_s[0])

    def mean(self, values: Array) -> Array:
        """Average values of the grid's intervals, (n - 1, ...), over each span of them."""
        averaged = max(2, round(_AVERAGED_S / self.dt_s))
        spans = len(values) // averaged
        mean: Array = values[: spans * averaged].reshape(spans, averaged, *values.shape[1:]).mean(axis=1)
        return mean

    def middle(self, values: Array) -> Array:
        """Average values on the grid, (n, ...), over the same spans."""
        return self.mean(0.5 * (values[1:] + values[:-1]))

    def shares(self, lag: _Lag) -> Array:
        """Return rotor speeds on the grid by the commands, in parts of the top speed."""
        c = self.command.at(self.t_s + 0.5 * self.dt_s - lag.delay_s).clip(0.0, 1.0)
        shares: Array = np.sqrt(((1.0 - lag.curve) * c + lag.curve * c * c).clip(0.0))
        _follow(shares, exp(-self.dt_s / lag.up_s), exp(-self.dt_s / lag.down_s))
        return shares


@compiled
def _follow(targets: Array, kept_up: float, kept_down: float) -> None:
    """Replace targets, (n, rotors), by the speeds that follow them; each target holds until the next."""
    for rotor in range(targets.shape[1]):
        share = targets[0, rotor]
        for k in range(targets.shape[0]):
            target, targets[k, rotor] = targets[k, rotor], share
            share = target + (share - target) * (kept_up if target > share else kept_down)


def _flight(motion: Motion, vehicle: Vehicle) -> _Flight:
    """Return the longest flight of a log on an even grid of time."""
    count = int((motion.command.values.max(axis=0) > 0.0).sum())
    if count != vehicle.rotors.count:
        raise LogError(f"the log has commands of {count} rotors, the vehicle {vehicle.rotors.count}")
    order = np.argsort(vehicle.rotors.px4_numbering().rotors) if motion.is_numbered else np.arange(count)
    command = motion.command._replace(values=motion.command.values[:, order])
    times = [motion.attitude.times, *(each.t_s for each in (motion.rate, motion.velocity, motion.force, command))]
    dt_s = min(max(motion.rate.interval_s, 0.002), 0.01)
    grid = np.arange(max(t_s[0] for t_s in times), min(t_s[-1] for t_s in times), dt_s)
    grid = grid[_airborne(command.at(grid).mean(axis=1), dt_s)]
    if len(grid) * dt_s < 10.0:
        raise LogError(f"{len(grid) * dt_s:.1f} s of flight between take-off and landing: 10 s are required")
    turn, velocity = motion.attitude(grid), motion.velocity.at(grid)
    if np.sqrt((velocity * velocity).mean()) < 0.05:
        raise LogError("the vehicle does not move in the log: a flight with turns, climbs and speed is required")
    speed = None
    if motion.speed is not None and motion.speed.interval_s <= 0.5 * _AVERAGED_S:
        top = vehicle.rotors.max_speed * vehicle.rad_s_per_speed_unit
        speed = motion.speed.at(grid)[:, order] / top
    force = motion.force.at(0.5 * (grid[1:] + grid[:-1]))
    body = turn.apply(velocity, inverse=True)
    return _Flight(vehicle, grid, motion.rate.at(grid), body, turn.as_matrix(), force, command, speed)


def _airborne(throttle: Array, dt_s: float) -> slice:
    """Return the longest flight: throttle around that of hover, less take-off and landing."""
    span, settled = round(1.0 / dt_s), round(_SETTLED_S / dt_s)
    running = throttle > 0.05
    if running.sum() < span:
        return slice(0)
    smooth = np.convolve(throttle, np.ones(span) / span, mode="same")
    flying = np.concatenate([[False], smooth > 0.6 * np.median(throttle[running]), [False]])
    edges = np.flatnonzero(np.diff(flying)).reshape(-1, 2)
    begin, end = max(edges.tolist(), key=lambda run: run[1] - run[0])
    return slice(begin + settled, max(end - settled, begin + settled))


class _Channel(NamedTuple):
    """An equation y = X c; the first coefficient is the vehicle's."""

    quantity: str
    unit: str
    y: Array  # (rows,)
    x: Array  # (rows, k)
    t_s: Array  # of each row, from the begin of the flight


def _speed_channels(flight: _Flight, lag: _Lag) -> list[_Channel]:
    """Compare measured rotor speeds, if any, with those by the commands."""
    if flight.speed is None:
        return []
    t_s = np.repeat(flight.t_s - flight.t_s[0], flight.speed.shape[1])
    return [_Channel("rotor speed", "parts", flight.speed.ravel(), flight.shares(lag).reshape(-1, 1), t_s)]


def _body_channels(flight: _Flight, rotors: Array) -> list[_Channel]:
    """Return the equations of motion of the body."""
    vehicle, mean, middle = flight.vehicle, flight.mean, flight.middle
    top, mass = vehicle.rotors.max_speed, vehicle.body.mass_kg
    jx, jy, jz = vehicle.body.inertia_kg_m2
    thrust, roll, pitch, yaw = middle(rotors * rotors @ (vehicle.allocation() * top * top).T).T
    force = middle(rotors * rotors @ (vehicle.wrenches()[:3] * top * top).T)
    h = rotors @ (vehicle.momentum_along_z() * top)
    (p, q, r), turning = flight.rate.T, mean(np.diff(flight.rate, axis=0) / flight.dt_s).T
    qr, pr, pq, qh, ph = map(middle, (q * r, p * r, p * q, q * h, p * h))
    h_rate, one, t_s = mean(np.diff(h) / flight.dt_s), np.ones(len(thrust)), middle(flight.t_s - flight.t_s[0])
    x, y, _ = vehicle.arms_m().T
    swept = rotors * (x * (flight.velocity[:, 1:2] + np.outer(r, x)) - y * (flight.velocity[:, :1] - np.outer(r, y)))
    slowing = middle(-swept.sum(axis=1))  # the rotors' drag about z
    specific = mean(flight.force)

    def channel(quantity: str, unit: str, y: Array, *columns: Array) -> _Channel:
        return _Channel(quantity, unit, y, np.stack(columns, axis=1), np.resize(t_s, len(y)))

    assert vehicle.drag is not None
    linear = vehicle.drag.linear_n_s_m
    vertical = middle(-linear[2] / mass * flight.velocity[:, 2])
    holds = (sum(linear[:2]) / 2.0 + vehicle.drag.rotor_coefficient * top * rotors.sum(axis=1))[:, None] / mass
    east, north = (middle(holds * flight.turn[:, place, :2]) for place in (0, 1))  # drag in a wind of 1 m/s
    sides = (middle(-holds * flight.velocity[:, :2]), east, north, np.outer(one, [1.0, 0.0]), np.outer(one, [0.0, 1.0]))
    lateral = specific[:, :2] - force[:, :2] / mass
    return [
        channel("roll", "rad/s²", turning[0], roll / jx, -qh / jx, qr, one),
        channel("pitch", "rad/s²", turning[1], pitch / jy, ph / jy, pr, one),
        channel("yaw", "rad/s²", turning[2], yaw / jz, -h_rate / jz, pq, slowing, one),
        channel("thrust", "m/s²", specific[:, 2], thrust / mass, vertical),
        channel("drag", "m/s²", lateral.T.ravel(), *(side.T.ravel() for side in sides)),
    ]


class _Solution(NamedTuple):
    c: Array
    off: Array  # half-width of the 95 % interval of each
    left: Array  # residuals

    def own(self, place: int = 0) -> tuple[float, float]:
        """Return a coefficient and the relative half-width of its interval."""
        c, off = float(self.c[place]), float(self.off[place])
        return c, off / c if c > 0.0 else inf


def _solve(channel: _Channel) -> _Solution:
    """Fit a channel to the first part of the flight."""
    trained = channel.t_s < _TRAINED * channel.t_s[-1]
    x, y = channel.x[trained], channel.y[trained]
    c = np.linalg.lstsq(x, y)[0]
    left = y - x @ c
    return _Solution(c, _half_widths(x, left, channel.t_s[trained]), left)


def _half_widths(jacobian: Array, left: Array, t_s: Array) -> Array:
    """Return the half-widths of 95 % intervals by the scatter between seconds."""
    blocks = t_s.astype(int)
    count = int(blocks.max()) + 1
    scores = np.zeros((count, jacobian.shape[1]))
    np.add.at(scores, blocks, jacobian * left[:, None])
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12, hermitian=True)
    spread = inverse @ (scores.T @ scores) @ inverse * count / (count - 1)
    widths: Array = np.sqrt(np.diag(spread).clip(0.0)) * stdtrit(count - 1, 0.975)
    return widths


def _fit_lag(flight: _Flight) -> tuple[_Lag, Sequence[float]]:
    """Fit lag, delay and thrust curve to measured speeds, or else to the accelerations.

    The curve is that of the first file if the flight does not tell. Without measured speeds, commands logged less often
    than twice in a lag tell no lag: then it is the best for this log, of use for the accelerations alone. Half-widths
    of the intervals are relative, of delay and curve absolute; infinite if the number is not in the log.
    """
    curve = 1.0 if flight.vehicle.rotors.control == "speed" else 0.0
    starts = [_Lag(s, s, delay_s, curve) for s in (0.01, 0.02, 0.04, 0.08, 0.16) for delay_s in (0.0, 0.01, 0.03)]

    def channels(lag: _Lag) -> list[_Channel]:
        return _speed_channels(flight, lag) or _body_channels(flight, flight.shares(lag))[:4]

    def residuals(numbers: Array | Sequence[float], /) -> Array:
        """Return relative residuals of a lag, or of one without its curve."""
        found = channels(_Lag(*[*numbers, curve][:4]))
        return np.concatenate([_solve(channel).left / max(float(np.std(channel.y)), 1e-9) for channel in found])

    start = min(starts, key=lambda lag: float(np.abs(residuals(lag)).sum()))
    t_s = np.concatenate([each.t_s[each.t_s < _TRAINED * each.t_s[-1]] for each in channels(start)])
    for free in (4, 3):  # with the curve, or without
        fit = least_squares(
            residuals,
            start[:free],
            bounds=(_LOW[:free], _HIGH[:free]),
            x_scale="jac",
            loss="soft_l1",  # rotors at the battery's limit turn more slowly than commanded
            f_scale=3.0 * float(np.median(np.abs(residuals(start)))) + 1e-9,
        )
        lag = _Lag(*[*fit.x.tolist(), curve][:4])
        widths = [*_half_widths(np.asarray(fit.jac, float), fit.fun, t_s), inf][:4]
        if widths[3] <= _WIDEST:
            break
    rare = flight.speed is None and flight.command.interval_s > 0.5 * min(lag.up_s, lag.down_s)
    return lag, [*(inf if rare else widths[place] / lag[place] for place in (0, 1)), *widths[2:]]


def _numbers(vehicle: Vehicle, lag: _Lag, lag_off: Sequence[float], solutions: dict[str, _Solution]) -> list[Number]:
    thrust, roll, pitch, yaw, drag = (solutions[name].own() for name in ("thrust", "roll", "pitch", "yaw", "drag"))
    top = solutions["rotor speed"].own() if "rotor speed" in solutions else (1.0, inf)
    of_lag = min(hypot(*lag_off[:2]), _RARE) if top[1] == inf else 0.0
    x = thrust[0] / roll[0], hypot(thrust[1], roll[1], of_lag)
    y = thrust[0] / pitch[0], hypot(thrust[1], pitch[1], of_lag)
    z = _yaw_inertia(vehicle.body.inertia_kg_m2, x, y, solutions)
    first = vehicle.rotors.lag
    assert first is not None
    ratios = {
        "rotors.thrust_coefficient": thrust,
        "rotors.max_speed": top,
        "rotors.idle_speed": top,
        "rotors.torque_coefficient": (yaw[0] * z[0], hypot(yaw[1], z[1])),
        "rotors.lag.time_constant_up_s": (lag.up_s / first.time_constant_up_s, lag_off[0]),
        "rotors.lag.time_constant_down_s": (lag.down_s / first.time_constant_down_s, lag_off[1]),
        "body.inertia_kg_m2.0": x,
        "body.inertia_kg_m2.1": y,
        "body.inertia_kg_m2.2": z,
        "drag.linear_n_s_m.0": drag,
        "drag.linear_n_s_m.1": drag,
        "drag.linear_n_s_m.2": solutions["thrust"].own(1),
        "drag.rotor_coefficient": drag,
    }
    before = {key: value_at(vehicle, key, VehicleError) for key in ratios}
    return [Number(key, before[key], before[key] * ratio, off) for key, (ratio, off) in ratios.items()]


def _yaw_inertia(
    first: tuple[float, float, float], x: tuple[float, float], y: tuple[float, float], solutions: dict[str, _Solution]
) -> tuple[float, float]:
    """Return the part of Iz by gyroscopic moments and by its ratio to Ix + Iy in the first file.

    Yaw tells only cQ / Iz.
    """
    roll, pitch = solutions["roll"], solutions["pitch"]
    ix, iy = x[0] * first[0], y[0] * first[1]
    usual = first[2] / (first[0] + first[1]) * (ix + iy)
    estimates = np.array([iy - roll.c[2] * ix, ix + pitch.c[2] * iy, usual])
    off = np.array([roll.off[2] * ix, pitch.off[2] * iy, _YAW_INERTIA * usual])
    weights = 1.0 / (off**2 + (estimates * max(x[1], y[1])) ** 2)
    iz = np.clip(np.average(estimates, weights=weights), 1.001 * abs(ix - iy), 0.999 * (ix + iy))  # of a rigid body
    return float(iz / first[2]), float(weights.sum() ** -0.5 / iz)
