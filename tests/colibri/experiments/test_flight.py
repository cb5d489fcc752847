"""Flights from Python: the command's options as keywords, objects in place of names, and what a flight shows."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

import colibri
from colibri.analysis.recording import COLUMNS
from colibri.cli.main import main
from colibri.flights.provenance import plan_of
from colibri.flights.replay import replay_flight
from tests.support.campaigns import Hovers
from tests.support.refusals import refusal_of

HOVER = {"duration": 0.4, "start": {"x": 0.1, "z": 2.0}}


@pytest.fixture(scope="module")
def hover() -> colibri.Flight:
    return colibri.fly("hover", **HOVER)


def test_it_is_the_flight_of_the_command_line(hover: colibri.Flight, tmp_path: Path) -> None:
    options = ["--duration", "0.4", "--start", "x=0.1,z=2", "--link", "memory", "--no-figures", "--quiet"]
    assert main(["fly", "hover", *options, "--out", str(tmp_path)]) == 0
    again = (tmp_path / "report.json").read_text(encoding="utf-8")
    assert f'"{hover.sha256}"' in again
    assert hover.lost is None


def test_samples_and_frames_are_tables(hover: colibri.Flight) -> None:
    assert hover.samples.dtype.names == COLUMNS
    assert type(hover.samples["x"]) is np.ndarray
    assert hover.samples["x"][0] == 0.1
    assert hover.samples["t"] == pytest.approx(np.arange(51) * 0.008)
    assert hover.frames["t"] == pytest.approx(np.arange(101) * 0.004)
    assert hover.estimate is None


def test_on_sensors_there_is_an_estimate() -> None:
    flight = colibri.fly("hover", feedback="sensors", duration=1.5, seed=1)
    assert flight.estimate is not None
    assert flight.estimate["t"][-1] == pytest.approx(1.496)
    assert flight.estimate["sd_z"].min() > 0.0


def test_a_table_becomes_a_data_frame_of_its_columns(hover: colibri.Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))  # pandas is not among what tests need
    frame = hover.samples.to_pandas()
    assert list(frame) == list(COLUMNS)
    assert all(column.dtype == np.float64 and (column == hover.samples[name]).all() for name, column in frame.items())


def test_without_pandas_one_line_says_so(hover: colibri.Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(colibri.Error, match="pip install pandas"):
        hover.samples.to_pandas()


def test_nothing_stays_unless_it_is_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flight = colibri.fly("hover", duration=0.1)
    assert not list(tmp_path.iterdir())
    saved = flight.save(tmp_path / "kept")
    assert {"flight.csv", "report.json", "flight.ulg", "provenance.json"} <= {path.name for path in saved.iterdir()}
    with pytest.raises(colibri.Error, match="is not empty: choose another folder"):
        flight.save(saved)
    assert replay_flight(saved) == (25, 96_000, None)
    assert colibri.read_recording(plan_of(saved)).trajectory_sha256 == flight.sha256


def test_profile_and_vehicles_are_changed_by_their_keys(hover: colibri.Flight) -> None:
    heavier = colibri.load_vehicle("hummingbird").replace("body.mass_kg", 0.8)
    profile = colibri.load_profile("flight").replace("controllers.lpv-mpc.weights.rate", 0.02)
    flight = colibri.fly("hover", profile=profile, plant_vehicle=heavier, **HOVER)
    assert (flight.report["profile"], flight.plan.plant_vehicle.body.mass_kg) == ("flight*", 0.8)
    assert flight.plan.vehicle.body.mass_kg == hover.plan.vehicle.body.mass_kg
    assert flight.samples["z"][-1] < hover.samples["z"][-1] - 0.002


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("body.mas_kg", 1.0, 'body.mas_kg: unknown key "mas_kg" (did you mean "mass_kg"?)'),
        ("body.mass_kg", -1.0, "body.mass_kg: Expected `float` > 0.0"),
        (
            "body.inertia_kg_m2",
            [1.0, 1.0, 9.0],
            "body: inertia_kg_m2: 9 exceeds 2, the sum of the other two (nearest valid: [3.337, 3.337, 6.667])",
        ),
        ("rotors.speed_unit", "deg/s", "choose rad/s, rpm"),
        ("wings", 2, 'wings: unknown key "wings" (choose'),
    ],
)
def test_a_change_is_checked_as_a_file_is(key: str, value: Any, said: str) -> None:
    assert said in refusal_of(colibri.load_vehicle("hummingbird").replace, key, value)


def test_a_class_flies_without_an_entry_point(tmp_path: Path) -> None:
    profile = colibri.load_profile("flight").replace("controllers.Hovers", {"part": 0.5})
    flight = colibri.fly("hover", profile=profile, controller=Hovers, **HOVER)
    assert flight.report["controller"] == "Hovers"
    assert flight.samples["omega1"][-1] == pytest.approx(0.5 * flight.plan.vehicle.hover_speed, rel=0.01)
    kept = (flight.save(tmp_path / "kept") / "provenance.json").read_text(encoding="utf-8")
    assert f'"{Hovers.__module__}:Hovers"' in kept


def test_what_it_raises_in_flight_is_raised_here() -> None:
    class Fails(Hovers):
        def step(self, *_: Any) -> Any:
            raise ZeroDivisionError("by zero")

    with pytest.raises(colibri.Error, match=r"controller Fails raised at t = 0\.000 s: ZeroDivisionError: by zero"):
        colibri.fly("hover", controller=Fails, duration=0.1)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"durations": 22}, 'unknown option "durations" (did you mean "duration"?)'),
        ({"colour": "red"}, 'unknown option "colour" (choose controller, delay, duration'),
        ({"wind": "much"}, "wind: must be SPEED@FROM in m/s and degrees, for example 5@270, not much"),
        ({"duration": -1}, "duration: must be a number above 0 s, not -1"),
        ({"start": {"height": 2.0}}, 'start: unknown key "height" (choose x, y, z'),
        ({"profile": "fligt"}, 'unknown profile "fligt" (did you mean "flight"?)'),
        ({"vehicle": 3}, "vehicle: must be a name or a Vehicle, not int"),
        ({"controller": "their-law"}, 'unknown controller "their-law" (choose '),
    ],
)
def test_bad_options_are_refused_in_one_line(options: dict[str, Any], said: str) -> None:
    assert refusal_of(colibri.fly, "hover", **options).startswith(said)


def test_a_notebook_shows_table_and_figure(hover: colibri.Flight) -> None:
    (axes, *_) = hover.plot("position").axes
    shown = [np.asarray(line.get_xdata()) for line in axes.lines]
    assert any(np.array_equal(t, hover.samples["t"]) for t in shown)
    with pytest.raises(colibri.Error, match='unknown figure "speed"'):
        hover.plot("speed")
    page = hover._repr_html_()
    assert "position error, RMS" in page
    assert '<img src="data:image/png;base64,iVBOR' in page


def test_a_recorded_flight_is_loaded_as_it_flew(hover: colibri.Flight, tmp_path: Path) -> None:
    saved = hover.save(tmp_path / "kept")
    loaded = colibri.load_flight(saved)
    assert (loaded.sha256, loaded.report) == (hover.sha256, hover.report)
    assert loaded.samples.tobytes() == hover.samples.tobytes()
    assert loaded.frames.tobytes() == hover.frames.tobytes()
    assert loaded.plot("error")
    (saved / "report.json").unlink()
    assert colibri.load_flight(str(saved)).sha256 == hover.sha256


def _with(content: bytes | None) -> Any:
    def spoil(folder: Path) -> None:
        (folder / "report.json").write_bytes(content) if content is not None else (folder / "flight.ulg").unlink()

    return spoil


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_with(b"{"), "report.json: "),
        (_with(b"[1]"), "report.json: Expected `object`"),
        (_with(None), "flight.ulg is missing"),
        (lambda folder: (folder / "flight.ulg").write_bytes(b""), "flight.ulg: not a ULog"),
        (lambda folder: (folder / "provenance.json").unlink(), "is not a flight folder of this version"),
    ],
)
def test_a_folder_without_flight_is_refused(hover: colibri.Flight, spoil: Any, said: str, tmp_path: Path) -> None:
    spoil(hover.save(tmp_path / "kept"))
    assert said in refusal_of(colibri.load_flight, tmp_path / "kept")


class Accelerates(Hovers):
    """Record the states that a law receives."""

    states: ClassVar[list[colibri.VehicleState]] = []

    def step(self, memory: Any, time_us: int, state: colibri.VehicleState, references: Any) -> Any:
        self.states.append(state)
        return super().step(memory, time_us, state, references)


@pytest.mark.parametrize("options", [{}, {"feedback": "sensors", "duration": 2.0}, {"delay": 20.0}])
def test_laws_receive_acceleration_and_rotor_speeds(options: dict[str, Any]) -> None:
    Accelerates.states.clear()
    profile = colibri.load_profile("flight").replace("controllers.Accelerates", {"part": 1.05})
    flight = colibri.fly("hover", profile=profile, controller=Accelerates, **{"duration": 1.0, **options})
    states, hover = Accelerates.states, flight.plan.vehicle.hover_speed
    assert states[-1].rotor_speeds == pytest.approx([1.05 * hover] * 4, rel=1e-6)
    assert states[-1].acceleration_enu_m_s2[2] == pytest.approx((1.05**2 - 1.0) * 9.81, abs=0.3)
    assert states[-1].acceleration_flu_m_s2 == pytest.approx(states[-1].acceleration_enu_m_s2, abs=0.3)
    if not options:
        omega = flight.samples["omega1"]
        assert [state.rotor_speeds[0] for state in states] == pytest.approx(omega[: len(states)], rel=1e-6)
        vz = [state.velocity_enu_m_s[2] for state in states]
        assert [state.acceleration_enu_m_s2[2] for state in states[1:]] == pytest.approx(np.diff(vz) / 0.01, abs=1e-6)
