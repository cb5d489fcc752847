"""Table and figure of `rotor-loss.md`: flights that lose a rotor."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colibri.analysis.figures import GRID, put_head, write_figure
from colibri.analysis.tables import markdown
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.ground.stations import StationSettings
from colibri.campaigns.engines import in_order
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.rotations import tilt_deg
from colibri.common.types import Array
from colibri.flights.flight import SteppedFlight, direct_flight
from colibri.mavlink.hil.faults import MOTOR, OFF, WRONG, Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.environment.weather import Intensity, Wind
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import state_frame
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import load_vehicle
from tools.pages.tables import with_tables

HEIGHT_M = 10.0
UPRIGHT_DEG, NEAR_M, SOFT_M_S = 20.0, 5.0, 2.0  # largest tilt once settled, distance and speed at touch-down
SETTLED_S = 1.0  # after the loss; then the vehicle is upright for good
COLUMNS = ("t", "x", "y", "z", "vz", "tilt", "spin", "c1", "c2", "c3", "c4")
"""s since the loss, m from its place (z above ground), m/s, degrees, rad/s, parts of the largest."""
_T, _X, _Y, _Z, _VZ, _TILT, _SPIN = range(7)
_BLADES_LEFT = 0.001
_BEFORE_S, _AFTER_S, _MAX_DURATION_S = 1.0, 1.5, 40.0
_LOW_M = 0.3
_FULL_TURN_DEG = 360.0


class RotorLossCase(NamedTuple):
    name: str
    feedback: Feedback
    runs_down: bool = False  # with its motor; else the thrust is gone at once
    wind_m_s: float = 0.0  # its direction varies by seed
    turbulence: Intensity | None = None


class RotorLossFlight(NamedTuple):
    """A flight; what is measured ends with the touch-down."""

    seed: int  # of everything random; the rotor is seed mod 4
    path: Array  # `COLUMNS`, one row a frame until the vehicle rests, (n, 11)
    noticed_ms: float  # from the loss to its detection; nan without
    peak_deg: float
    upright_s: float  # when the tilt falls below 20° for good
    settled_deg: float  # largest tilt from 1 s on
    max_distance_m: float
    landed_m: float
    touched_m_s: float
    spin_rad_s: float
    rest_deg: float
    well: bool


def measured(seed: int, noticed_s: float, path: Array, *, rights: bool) -> RotorLossFlight:
    """Measure a flight; `rights`: the right rotor was named."""
    after = path[path[:, _T] > 0.0]
    # A larger change of the vertical speed between rows is the ground's.
    touched = np.flatnonzero(np.diff(after[:, _VZ]) > 9.81 * (after[1, _T] - after[0, _T]))
    low = [row for row in touched.tolist() if after[row, _Z] < _LOW_M]
    t, x, y, _, vz, tilt, spin = (after[: low[0] + 1] if low else after).T[: _SPIN + 1]
    beyond, away_m = np.flatnonzero(tilt > UPRIGHT_DEG), np.hypot(x, y)
    settled_deg, rest_deg, touched_m_s = float(tilt[t > SETTLED_S].max()), float(path[-1, _TILT]), float(-vz[-1])
    landed_m, upright = float(away_m[-1]), max(settled_deg, rest_deg) <= UPRIGHT_DEG
    return RotorLossFlight(
        seed=seed,
        path=path,
        noticed_ms=1e3 * noticed_s,
        peak_deg=float(tilt.max()),
        upright_s=float(t[beyond[-1]]) if beyond.size else 0.0,
        settled_deg=settled_deg,
        max_distance_m=float(away_m.max()),
        landed_m=landed_m,
        touched_m_s=touched_m_s,
        spin_rad_s=float(np.abs(spin).max()),
        rest_deg=rest_deg,
        well=rights and upright and landed_m <= NEAR_M and touched_m_s <= SOFT_M_S,
    )


def fly(case: RotorLossCase, seed: int) -> RotorLossFlight:
    profile = load_profile("flight")
    vehicle = load_vehicle(profile.simulation.vehicle)
    wind = Wind(case.wind_m_s, _FULL_TURN_DEG * seed / 50.0)
    world = WorldSpec(wind=wind, turbulence=case.turbulence, seed=seed)
    settings = StationSettings(1, "px4", DEFAULT_ORIGIN, feedback=case.feedback)
    values = {"MIS_TAKEOFF_ALT": HEIGHT_M}
    autopilot = copter_autopilot(profile, vehicle, settings, lambda: 0.0, values=values)
    flight = direct_flight(autopilot, world, vehicle, case.feedback, Start(psi=_FULL_TURN_DEG * seed / 50.0))
    _take_off(flight)
    rotor = seed % 4 + 1
    blades_gone = Fault(MOTOR, WRONG, rotor, (_BLADES_LEFT, 0.0, 0.0, 0.0))
    return _lose(flight, seed, Fault(MOTOR, OFF, rotor) if case.runs_down else blades_gone)


def _take_off(flight: SteppedFlight[Copter]) -> None:
    copter, plant = flight.autopilot.stages, flight.plant
    while copter.pilot.sensed.vehicle is None or copter.pilot.readiness.refusals():
        flight.step()
        assert plant.world.time_us < _MAX_DURATION_S * 1e6, "it must be ready to arm"
    copter.pilot.select(Mode.TAKEOFF, {})
    copter.pilot.arm({})
    began_us = plant.world.time_us
    while copter.pilot.state.mode is not Mode.HOLD:
        flight.step()
        assert plant.world.time_us < began_us + _MAX_DURATION_S * 1e6, "it must reach its height"


def _lose(flight: SteppedFlight[Copter], seed: int, fault: Fault) -> RotorLossFlight:
    copter, plant = flight.autopilot.stages, flight.plant
    lost_us = plant.world.time_us + round(_BEFORE_S * 1e6)
    rows: list[tuple[float, ...]] = []
    ends_us, noticed_s = lost_us + round(_MAX_DURATION_S * 1e6), nan
    while plant.world.time_us < ends_us:
        if plant.world.time_us == lost_us:
            plant.inject([fault])
        controls = flight.step().command.controls
        after_s = (plant.world.time_us - lost_us) * 1e-6
        frame = state_frame(plant.world)
        tilt_spin = (tilt_deg(frame.attitude), frame.rate_flu_rad_s[2])
        rows.append((after_s, *frame.position_enu_m, frame.velocity_enu_m_s[2], *tilt_spin, *controls))
        if copter.parts.rotor_loss.lost is not None and np.isnan(noticed_s):
            noticed_s = after_s - plant.interval_us * 1e-6
        if not copter.pilot.state.armed:
            ends_us = min(ends_us, plant.world.time_us + round(_AFTER_S * 1e6))
    path = np.array(rows)
    at_loss = int(np.argmin(np.abs(path[:, _T])))
    path[:, _X : _Y + 1] -= path[at_loss, _X : _Y + 1]
    return measured(seed, noticed_s, path, rights=copter.parts.rotor_loss.lost == fault.instance - 1)


SEEDS = range(50)
CASES = (
    RotorLossCase("state feedback, calm; the blades fly off", Feedback.STATE),
    RotorLossCase("sensors, calm; the blades fly off", Feedback.SENSORS),
    RotorLossCase("sensors, calm; the motor runs down", Feedback.SENSORS, runs_down=True),
    RotorLossCase(
        "sensors, 3 m/s and light turbulence; the blades fly off", Feedback.SENSORS, wind_m_s=3.0, turbulence="light"
    ),
    RotorLossCase(
        "sensors, 5 m/s and moderate turbulence; the same", Feedback.SENSORS, wind_m_s=5.0, turbulence="moderate"
    ),
)
_DRAWN = CASES[3]
_THICK_SEED = 5
_MEASURES = (
    ("detected after (ms)", "noticed_ms", ".0f"),
    ("largest tilt (°)", "peak_deg", ".1f"),
    ("below 20° for good after (s)", "upright_s", ".2f"),
    ("tilt from 1 s on (°)", "settled_deg", ".1f"),
    ("farthest (m)", "max_distance_m", ".2f"),
    ("landed at (m)", "landed_m", ".2f"),
    ("touch-down (m/s)", "touched_m_s", ".2f"),
    ("spin (rad/s)", "spin_rad_s", ".1f"),
)
_MANY, _ONE, _LIMIT = "#9DB8D2", "#0B3C6F", "#D55E00"
_ROTORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_FIRST_S, _WHOLE_S = (-0.1, 2.0), (-0.5, 16.0)


def table(flown: Mapping[RotorLossCase, Sequence[RotorLossFlight]]) -> str:
    headings = ("50 flights each", "successful", *(name for name, _, _ in _MEASURES))
    rows = [(case.name, f"{sum(one.well for one in of)} of {len(of)}", *_cells(of)) for case, of in flown.items()]
    return markdown(headings, rows, names=1)


def draw(flown: Sequence[RotorLossFlight], title: str) -> Figure:
    figure = Figure(figsize=(10.0, 9.6), dpi=130)
    grid = figure.add_gridspec(5, 2, top=0.9, bottom=0.055, left=0.08, right=0.985, hspace=0.14, wspace=0.13)
    quantities: tuple[tuple[str, Callable[[Array], Array]], ...] = (
        ("height (m)", lambda path: path[:, _Z]),
        ("off its place (m)", lambda path: np.hypot(path[:, _X], path[:, _Y])),
        ("tilt of the thrust (°)", lambda path: path[:, _TILT]),
        ("spin (rad/s)", lambda path: np.abs(path[:, _SPIN])),
    )
    for column, shown in enumerate((_FIRST_S, _WHOLE_S)):
        for row, (name, quantity) in enumerate(quantities):
            axes = figure.add_subplot(grid[row, column])
            for one in sorted(flown, key=lambda one: one.seed == _THICK_SEED):
                is_one = one.seed == _THICK_SEED
                style: dict[str, Any] = (
                    {"color": _ONE, "linewidth": 1.4} if is_one else {"color": _MANY, "linewidth": 0.4}
                )
                label = f"seed {one.seed}" if is_one else "the other seeds"
                axes.plot(one.path[:, 0], quantity(one.path), label=label, **style)
            _finish(axes, name if column == 0 else "", shown)
            if name.startswith("tilt"):
                axes.axhline(UPRIGHT_DEG, color=_LIMIT, linewidth=0.9, linestyle="--", label="20°")
        axes = figure.add_subplot(grid[len(quantities), column])
        path = next(one.path for one in flown if one.seed == _THICK_SEED)
        for rotor, color in enumerate(_ROTORS):
            commands = path[:, COLUMNS.index("c1") + rotor]
            axes.plot(path[:, 0], commands, color=color, linewidth=0.7, label=f"rotor {rotor + 1}")
        _finish(axes, "rotor commands" if column == 0 else "", shown, last=True)
    put_head(figure, title)
    return figure


def _finish(axes: Axes, name: str, shown: tuple[float, float], *, last: bool = False) -> None:
    axes.set_xlim(*shown)
    axes.set_ylabel(name)
    axes.grid(**GRID)
    axes.tick_params(labelbottom=last)
    if last:
        axes.set_xlabel("since the loss (s)")


def _cells(flown: Sequence[RotorLossFlight]) -> list[str]:
    cells = []
    for _, measure, form in _MEASURES:
        values = [getattr(one, measure) for one in flown]
        cells.append(f"{float(np.median(values)):{form}}; {max(values):{form}}")
    return cells


def write(folder: Path) -> bool:
    """Return whether all but the last case went well."""
    flown = {case: in_order(partial(fly, case), SEEDS, case.name, quiet=False) for case in CASES}
    path = folder / "rotor-loss.md"
    path.write_text(with_tables(path.read_text(encoding="utf-8"), [table(flown)]), encoding="utf-8")
    title = f"A rotor lost at {HEIGHT_M:.0f} m, {len(SEEDS)} seeds: {_DRAWN.name}"
    write_figure(draw(flown[_DRAWN], title), folder / "rotor-loss")
    return all(one.well for case in CASES[:-1] for one in flown[case])
