"""A recorded flight, from its folder."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from colibri.analysis.figure_series import Extremes
from colibri.analysis.logs import RecordingError, read_blocks, read_series
from colibri.analysis.recording import Lags, path_times, rotor_names
from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.errors import Error
from colibri.common.rotations import earth_from_body
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import plan_of
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.ulog.flight_topics import DECISION, ESTIMATE, MORE_TRUTH, ROTORS, TRUTH, Topic
from colibri.mavlink.ulog.reader import FILE, FlightFile
from colibri.plant.vehicle.description import Vehicle
from colibri.view.geometry import thinned
from colibri.view.recorded.horizons import Horizons
from colibri.view.snapshot import NOWHERE, Chart, Snapshot, Surroundings, VehicleShape, ViewError

MAX_ROWS = 30_000  # rows in memory: ten minutes at 50 Hz
CHART_POINTS = 512
_ROW_S = 0.02
_TRAIL_S = 8.0
_TRAIL_POINTS = 200
_PATH_POINTS = 4000
_EVENTS = 3  # number of latest controller events shown


class LogColumns(NamedTuple):
    times_s: Array
    named: dict[str, Array]

    def columns(self, *names: str) -> Array:
        return np.stack([self.named[name] for name in names], axis=1)

    def at(self, time_s: float, *names: str) -> Array:
        """Interpolate some columns, (len(names),)."""
        return np.array([_between(self.times_s, self.named[name], time_s) for name in names])


class RecordedFlight:
    """A recorded flight, reduced for display; a `Source`."""

    is_live = False

    def __init__(self, folder: Path, name: str = "", horizons: Horizons | None = None) -> None:
        try:
            self.plan = plan_of(folder)
            log = FlightFile(folder / FILE)
            self._truth = _read(log, TRUTH, _ROW_S)
            self._omegas = rotor_names(self.plan)
            if len(self._omegas) > ROTORS:
                more = _read(log, MORE_TRUTH, _ROW_S)
                rows = min(len(self._truth.times_s), len(more.times_s))
                named = {name: column[:rows] for name, column in (more.named | self._truth.named).items()}
                self._truth = LogColumns(self._truth.times_s[:rows], named)
            self._decisions = _read(log, DECISION, 0.0)
            on_sensors = self.plan.spec.feedback is Feedback.SENSORS
            self._estimate = _read(log, ESTIMATE, _ROW_S) if on_sensors else None
        except OSError as error:
            raise ViewError(f"{error.filename or folder}: {error.strerror}") from error
        except Error as error:
            raise ViewError(str(error) if str(folder) in str(error) else f"{folder}: {error}") from error
        self.name = name or folder.name or str(folder)
        self.airframe = airframe_of(self.plan.plant_vehicle)
        self.span_s = (float(self._truth.times_s[0]), float(self._truth.times_s[-1]))
        self._place = self._truth.columns("x", "y", "z")
        self._reference = _reference(self.plan, self._truth.times_s, self._decisions)
        self._full_speed = self.plan.plant_vehicle.rotors.max_speed
        self._horizons = horizons or Horizons()
        self._events = _events(self._decisions)
        self.surroundings = Surroundings(
            ground_m=_ground_m(self.plan.plant_vehicle, self._place),
            path=thinned(self._place, _PATH_POINTS),
            reference_path=thinned(self._reference, _PATH_POINTS),
            home_enu_m=(0.0, 0.0, _ground_m(self.plan.plant_vehicle, self._place)),
        )

    def at(self, time_s: float) -> Snapshot:
        truth, times_s = self._truth, self._truth.times_s
        row = int(np.searchsorted(times_s, time_s + 1e-9))
        at_s = min(max(time_s, self.span_s[0]), self.span_s[1])
        place = _between(times_s, self._place, at_s)
        attitude = truth.at(at_s, "qw", "qx", "qy", "qz")
        qw, qx, qy, qz = (attitude / np.linalg.norm(attitude)).tolist()
        speeds = truth.at(at_s, *self._omegas) / self._full_speed
        first = int(np.searchsorted(times_s, at_s - _TRAIL_S))
        trail = np.vstack([thinned(self._place[first:row], _TRAIL_POINTS), place])
        estimate, sigma = self._estimated(at_s)
        volts = float(truth.at(at_s, "voltage_v")[0])
        return Snapshot(
            time_s=at_s,
            position_enu_m=_vector(place),
            attitude=(qw, qx, qy, qz),
            velocity_enu_m_s=earth_from_body((qw, qx, qy, qz), _vector(truth.at(at_s, "u", "v", "w"))),
            rotors=tuple(speeds.tolist()),
            reference_enu_m=_vector(_between(times_s, self._reference, at_s)),
            trail=trail,
            horizon=self._horizons.at(at_s),
            wind_enu_m_s=_vector(truth.at(at_s, "wind_east", "wind_north", "wind_up")),
            estimate_enu_m=estimate,
            sigma_m=sigma,
            mode=f"track {self.plan.spec.track}, {self.plan.profile.controller}",
            armed=True,
            battery="" if np.isnan(volts) else f"{volts:.2f} V",
            texts=tuple(text for said_s, text in self._events if said_s <= at_s)[-_EVENTS:][::-1],
        )

    def charts(self) -> tuple[Chart, ...]:
        rotors = self.plan.plant_vehicle.rotors
        times_s = self._truth.times_s
        error = np.linalg.norm(self._place - self._reference, axis=1)
        qx, qy = self._truth.columns("qx", "qy").T
        tilt = np.degrees(np.arccos(np.clip(1.0 - 2.0 * (qx**2 + qy**2), -1.0, 1.0)))
        speeds = self._truth.columns(*self._omegas)
        limits = np.broadcast_to([rotors.idle_speed, rotors.max_speed], (len(times_s), 2))
        charts = [
            _chart("position error, m", ("error",), times_s, error[:, None]),
            _chart("tilt, deg", ("tilt",), times_s, tilt[:, None]),
            _chart(
                f"rotor speeds, {rotors.speed_unit}",
                (*(name.removeprefix("omega") for name in self._omegas), "(idle)", "(largest)"),
                times_s,
                np.hstack([speeds, limits]),
                speeds.max(axis=1),
            ),
        ]
        decided = self._decisions
        if len(decided.times_s) > 1:
            kinds = ("rotors", "increments", "angles", "rates")
            active = decided.columns(*(f"active_{kind}" for kind in kinds))
            charts += [
                _chart("active constraints", kinds, decided.times_s, active, active.sum(axis=1)),
                _chart("QP time, ms", ("QP",), decided.times_s, decided.columns("solve_time_us") / 1e3),
            ]
        if self._estimate is not None and len(self._estimate.times_s) > 1:
            charts.append(self._estimation_chart(self._estimate))
        known = np.isfinite(self._truth.named["voltage_v"])
        if known.any():
            charts.append(_chart("battery, V", ("voltage",), times_s[known], self._truth.columns("voltage_v")[known]))
        return tuple(charts)

    def _estimation_chart(self, estimate: LogColumns) -> Chart:
        truth = np.stack([np.interp(estimate.times_s, self._truth.times_s, axis) for axis in self._place.T], axis=1)
        wrong = estimate.columns("x", "y", "z") - truth
        bound = 3.0 * estimate.columns("sd_x", "sd_y", "sd_z").max(axis=1)[:, None]
        names = ("east", "north", "up", "(3σ)", "(-3σ)")
        values = np.hstack([wrong, bound, -bound])
        return _chart("estimate - truth, m", names, estimate.times_s, values, np.linalg.norm(wrong, axis=1))

    def _estimated(self, time_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        if self._estimate is None or not len(self._estimate.times_s):
            return NOWHERE, NOWHERE
        estimate = self._estimate
        return _vector(estimate.at(time_s, "x", "y", "z")), _vector(estimate.at(time_s, "sd_x", "sd_y", "sd_z"))


def airframe_of(vehicle: Vehicle) -> VehicleShape:
    foot_m = vehicle.ground.foot_depth_m if vehicle.ground else 0.0
    return VehicleShape(
        rotors_m=tuple((x, y) for x, y, _ in vehicle.arms_m().tolist()),
        spins=tuple(vehicle.rotors.spin().tolist()),
        foot_m=foot_m,
    )


def _read(log: FlightFile, topic: Topic, apart_s: float) -> LogColumns:
    (times_s,) = read_series(log, topic, "t")
    if not len(times_s):
        raise RecordingError(f"no {topic.name}: the flight ended before it began")
    interval_s = float(times_s[-1] - times_s[0]) / max(len(times_s) - 1, 1)
    step = max(1, round(apart_s / interval_s) if interval_s else 1, -(-len(times_s) // MAX_ROWS))
    wanted = np.zeros(len(times_s), dtype=np.bool_)
    wanted[::step] = wanted[-1] = True
    rows = np.vstack(list(read_blocks(log, topic, wanted)))
    return LogColumns(rows[:, 0], dict(zip(topic.names, rows.T, strict=True)))


def _reference(plan: FlightPlan, times_s: Array, decisions: LogColumns) -> Array:
    lags = Lags(decisions.times_s, decisions.named["path_lag_s"])
    return position(plan.track, path_times(times_s, lags))


def _ground_m(vehicle: Vehicle, place: Array) -> float:
    return vehicle.ground_height_m if vehicle.ground else min(0.0, float(place[:, 2].min()))


def _chart(title: str, names: tuple[str, ...], times_s: Array, values: Array, headline: Array | None = None) -> Chart:
    """Return a chart of series (n, k), reduced to extremes."""
    extremes = Extremes(values.shape[1] + 2, len(times_s), CHART_POINTS)
    shown = values[:, 0] if headline is None else headline
    extremes.add(np.column_stack([times_s, shown, values]))
    rows = np.vstack(extremes.points())
    return Chart(title, names, rows[:, 0], rows[:, 2:].T, rows[:, 1])


def _events(decisions: LogColumns) -> list[tuple[float, str]]:
    statuses = {code: status for status, code in STATUS_CODES.items()}
    fallbacks = {code: fallback for fallback, code in FALLBACK_CODES.items()}
    events = []
    for names, column, said in ((statuses, "qp_status", "QP"), (fallbacks, "fallback", "decided by")):
        codes = decisions.named[column].astype(int)
        for row in np.flatnonzero(np.diff(codes, prepend=codes[:1])).tolist():
            time_s = float(decisions.times_s[row])
            name: object = names.get(int(codes[row]), codes[row])
            events.append((time_s, f"{time_s:.2f} s: {said} {getattr(name, 'value', name)}".replace("_", " ")))
    return sorted(events)


def _between(times_s: Array, rows: Array, time_s: float) -> Array:
    after = min(max(int(np.searchsorted(times_s, time_s)), 1), max(len(times_s) - 1, 0))
    before = max(after - 1, 0)
    span_s = times_s[after] - times_s[before]
    part = min(max((time_s - times_s[before]) / span_s, 0.0), 1.0) if span_s > 0.0 else 1.0
    between: Array = rows[before] + part * (rows[after] - rows[before])
    return between


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
