from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from colibri.analysis.figure_series import FigureSeries, Series
from colibri.analysis.figures import (
    Curve,
    Panel,
    TimeFigure,
    draw_times,
    draw_trajectory,
    flight_figures,
    shortened,
    write_figure,
)
from colibri.analysis.recording import Recording, read_recording
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.plant.vehicle.description import load_vehicle

PNG = b"\x89PNG\r\n\x1a\n"
SVG = b"<?xml"
DEGREES = 180.0 / np.pi


class Flight(NamedTuple):
    recording: Recording
    flown: FigureSeries
    plan: FlightPlan
    series: Series
    figures: dict[str, Figure]


def fly(out: Path, duration_s: float) -> Flight:
    options = {"profile": "thesis", "link": "direct", "duration": duration_s, "integrator": "rk4", "out": out}
    plan = FlightPlan.of(FlightSpec.of("spiral", **options))
    fly_locally(plan)
    recording = read_recording(plan)
    flown = figure_series(recording, plan)
    series = flown.over_time()
    drawn = {figure.name: draw_times(series, figure, figure.subject) for figure in flight_figures(series, plan)}
    return Flight(recording, flown, plan, series, drawn)


def figure_series(recording: Recording, plan: FlightPlan) -> FigureSeries:
    return FigureSeries(plan, len(recording.table), [recording])


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return fly(tmp_path_factory.mktemp("short"), 5.0)


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return fly(tmp_path_factory.mktemp("long"), 25.0)


def axes_of(figure: Figure, quantity: str) -> list[Axes]:
    found = [axes for axes in figure.axes if axes.get_ylabel() == quantity]
    assert found, f"no axes of {quantity}"
    return found


def line(axes: Axes, label: str) -> Line2D:
    (found,) = [line for line in axes.lines if line.get_label() == label]
    return found


def drawn(line: Line2D) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


FOLLOWED = [
    *(("position", f"{axis} (m)", axis, 1.0) for axis in "xyz"),
    ("attitude", "φ (°)", "phi", DEGREES),
    ("attitude", "θ (°)", "theta", DEGREES),
    ("attitude", "ψ (°)", "psi", DEGREES),
]


@pytest.mark.parametrize(("name", "quantity", "column", "scale"), FOLLOWED)
def test_a_quantity_and_its_reference(short: Flight, name: str, quantity: str, column: str, scale: float) -> None:
    (axes,) = axes_of(short.figures[name], quantity)
    for label, wanted in (("flown", column), ("reference", f"{column}_ref")):
        t, values = drawn(line(axes, label))
        assert np.array_equal(t, short.recording["t"])
        assert values == pytest.approx(scale * short.recording[wanted], abs=1e-12)


def test_a_reference_is_wider_than_what_covers_it(short: Flight) -> None:
    for axes in (*short.figures["position"].axes, *short.figures["attitude"].axes):
        below, above = axes.lines
        assert (below.get_label(), above.get_label()) == ("reference", "flown")
        assert below.get_linewidth() >= 3.0 * above.get_linewidth()
        held = axes in short.figures["attitude"].axes
        assert (below.get_drawstyle(), above.get_drawstyle()) == ("steps-pre" if held else "default", "default")


@pytest.mark.parametrize(
    ("name", "quantity", "column"),
    [
        ("inputs", "U1 (N)", "U1"),
        *(("inputs", f"U{axis} (N m)", f"U{axis}") for axis in (2, 3, 4)),
        *(("rotors", f"Ω{rotor} (rpm)", f"omega{rotor}") for rotor in (1, 2, 3, 4)),
    ],
)
def test_an_input_is_held_up_to_its_row(short: Flight, name: str, quantity: str, column: str) -> None:
    (axes,) = axes_of(short.figures[name], quantity)
    held = axes.lines[-1]
    assert np.array_equal(drawn(held)[1], short.recording[column])
    assert held.get_drawstyle() == "steps-pre"


@pytest.mark.parametrize("vehicle", ["hummingbird-thesis", "hummingbird"])
def test_rotor_limits(short: Flight, vehicle: str) -> None:
    rotors = load_vehicle(vehicle).rotors
    plan = replace(short.plan, contents=short.plan.contents._replace(plant_vehicle=load_vehicle(vehicle)))
    series = figure_series(short.recording, plan).over_time()
    (figure,) = (figure for figure in flight_figures(series, plan) if figure.name == "rotors")
    for axes in draw_times(series, figure, "rotors").axes:
        limits = [set(drawn(line)[1]) for line in axes.lines if line.get_label() == "limits"]
        assert limits == [{rotors.idle_speed}, {rotors.max_speed}]


@pytest.mark.parametrize("size", [1e-7, 1e-3, 0.02, 1.0, 500.0, 1e5])
def test_no_label_of_an_axis_reaches_those_of_its_ticks(short: Flight, size: float) -> None:
    t = short.series["t"]
    values = {"t": t, "x": size * np.sin(t)}
    panel = Panel("error (m)", (Curve("x", "flown"),))
    figure = draw_times(values, TimeFigure("own", "own", ((panel, panel),) * 2), "a title")
    figure.draw_without_rendering()
    for axes in figure.axes:
        ticks = [tick.label1.get_window_extent().x0 for tick in axes.yaxis.get_major_ticks()]
        assert axes.yaxis.label.get_window_extent().x1 < min(ticks)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_velocity_is_the_slope_of_position(long: Flight, axis: str) -> None:
    (axes,) = axes_of(long.figures["position"], f"v{axis} (m/s)")
    t, velocity = drawn(line(axes, "flown"))
    position = long.recording[axis]
    travelled = position[0] + np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t))
    assert travelled == pytest.approx(position[1:], abs=0.02)


def test_trajectory(short: Flight) -> None:
    figure = draw_trajectory(short.flown.in_space(), "trajectory")
    (axes,) = figure.axes
    lines: dict[str, Any] = {str(line.get_label()): line for line in axes.lines}
    position = short.recording.columns(("x", "y", "z"))
    assert np.array_equal(np.array(lines["flown"].get_data_3d()).T, position)
    assert np.array_equal(
        np.array(lines["reference"].get_data_3d()).T, short.recording.columns(("x_ref", "y_ref", "z_ref"))
    )
    assert np.array_equal(np.array(lines["start"].get_data_3d()).T, position[:1])


def test_a_squeezed_trajectory_says_so(short: Flight) -> None:
    longer = short.series | {"y": 100.0 * short.series["y"]}
    titles = [draw_trajectory(series, "path").texts[0].get_text() for series in (short.series, longer)]
    assert titles == ["path", "path, axes not to scale"]


def test_errors(short: Flight) -> None:
    (distance,) = axes_of(short.figures["error"], "distance (m)")
    assert np.array_equal(drawn(distance.lines[-1])[1], short.recording.position_error_m)
    (errors,) = axes_of(short.figures["error"], "error (m)")
    for axis in "xyz":
        wanted = short.recording[axis] - short.recording[f"{axis}_ref"]
        assert np.array_equal(drawn(line(errors, f"error in {axis}"))[1], wanted)


def test_rms_only_once_settled(short: Flight, long: Flight) -> None:
    assert len(axes_of(short.figures["error"], "distance (m)")[0].lines) == 1
    error = long.recording.position_error_m[long.recording["t"] >= 20.0]
    rms = np.sqrt(np.mean(error**2))
    for axes in axes_of(long.figures["error"], "distance (m)"):
        t, values = drawn(line(axes, f"RMS after 20 s: {rms:.4f} m"))
        assert values[t >= 20.0] == pytest.approx(rms)
        assert np.isnan(values[t < 20.0]).all()


def test_a_long_flight_is_enlarged_where_something_happens(short: Flight, long: Flight) -> None:
    for name, begin_s, end_s in (("attitude", 0.0, 10.0), ("inputs", 0.0, 10.0), ("error", 20.0, 25.0)):
        whole, part = long.figures[name].axes[:2]
        assert drawn(whole.lines[-1])[0][[0, -1]] == pytest.approx([0.0, 25.0])
        assert drawn(part.lines[-1])[0][[0, -1]] == pytest.approx([begin_s, end_s])
        assert len(long.figures[name].axes) == 2 * len(short.figures[name].axes)


def test_a_figure_of_ones_own_in_two_formats(short: Flight, tmp_path: Path) -> None:
    row = (Panel("x (m)", (Curve("x", "flown"),), span_s=(1.0, 2.0)), Panel("U1 (N)", (Curve("U1", "", held=True),)))
    figure = draw_times(short.series, TimeFigure("own", "own", (row,)), "a title")
    png, svg = write_figure(figure, tmp_path / "own", ("png", "svg"))
    assert (png.name, svg.name) == ("own.png", "own.svg")
    assert png.read_bytes().startswith(PNG)
    assert svg.read_bytes().startswith(SVG)
    assert drawn(figure.axes[0].lines[0])[0][[0, -1]] == pytest.approx([1.0, 2.0])


def test_a_long_name_is_shortened_in_the_middle() -> None:
    assert shortened("circle:radius=3,speed=4") == "circle:radius=3,speed=4"
    assert shortened(f"waypoints:{'x' * 100}points.csv") == "waypoints:xxxxxxxx…xxxxxxxxpoints.csv"
