from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from colibri.experiments.flight import Flight, fly
from colibri.mavlink.ulog.log import beginning
from colibri.view.recorded.flight import RecordedFlight
from colibri.view.recorded.horizons import Horizons
from colibri.view.recorded.prediction import predicted
from colibri.view.run import PLOTTED_AFTER_S, WAITS_S, Show, export, read_flights
from colibri.view.snapshot import ViewError


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly("spiral", duration=1.6, profile="flight", feedback="sensors", link="memory")


@pytest.fixture(scope="module")
def folder(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flight.save(tmp_path_factory.mktemp("flight"))


@pytest.fixture(scope="module")
def recorded(folder: Path) -> RecordedFlight:
    return RecordedFlight(folder, "one")


def test_a_snapshot_is_what_the_logs_say(flight: Flight, recorded: RecordedFlight) -> None:
    table = flight.samples
    row = len(table["t"]) // 2
    now = recorded.at(float(table["t"][row]))
    assert now.position_enu_m == pytest.approx([table[name][row] for name in "xyz"], abs=2e-3)
    assert now.reference_enu_m == pytest.approx([table[f"{name}_ref"][row] for name in "xyz"], abs=2e-3)
    assert np.linalg.norm(now.attitude) == pytest.approx(1.0)
    full = flight.plan.plant_vehicle.rotors.max_speed
    assert now.rotors == pytest.approx([table[f"omega{n}"][row] / full for n in (1, 2, 3, 4)], abs=0.02)
    assert now.trail[-1].tolist() == pytest.approx(now.position_enu_m)
    assert all(sigma > 0.0 for sigma in now.sigma_m)


def test_beyond_its_ends_a_flight_stands(recorded: RecordedFlight) -> None:
    begin_s, end_s = recorded.span_s
    assert recorded.at(-5.0).position_enu_m == recorded.at(begin_s).position_enu_m
    assert recorded.at(99.0).position_enu_m == recorded.at(end_s).position_enu_m


def test_charts_have_all_that_is_judged(recorded: RecordedFlight) -> None:
    charts = {chart.title: chart for chart in recorded.charts()}
    assert {"position error, m", "tilt, deg", "active constraints", "QP time, ms", "estimate - truth, m"} <= set(charts)
    for chart in charts.values():
        assert chart.values.shape == (len(chart.names), len(chart.times_s))
        assert np.isfinite(chart.values).all()
        assert (np.diff(chart.times_s) >= 0.0).all()


def test_horizons_begin_at_the_vehicle_and_lead_ahead(folder: Path) -> None:
    horizons = Horizons()
    for time_s, points in predicted(folder):
        horizons.add(time_s, points)
    recorded = RecordedFlight(folder, horizons=horizons)
    now = recorded.at(1.5)
    assert len(now.horizon) > 2
    assert now.horizon[0].tolist() == pytest.approx(now.estimate_enu_m, abs=0.1)
    ahead = np.diff(now.horizon, axis=0) @ np.array(now.velocity_enu_m_s)
    assert (ahead > 0.0).all()
    assert not len(horizons.at(-1.0))
    assert not len(horizons.at(100.0))


def test_a_folder_without_a_flight_is_refused_in_one_line(tmp_path: Path, flight: Flight) -> None:
    with pytest.raises(ViewError, match="is not a flight folder"):
        RecordedFlight(tmp_path)
    copied = flight.save(tmp_path / "copy")
    (copied / "flight.ulg").write_bytes(beginning("Test", {}))
    with pytest.raises(ViewError, match="before it began"):
        RecordedFlight(copied)
    (copied / "flight.ulg").unlink()
    with pytest.raises(ViewError, match="No such file"):
        RecordedFlight(copied)


class Recorder:
    """A page that nobody sees: what was shown on it, and what shall have been done on it."""

    def __init__(self) -> None:
        self.watched, self.laid_out = True, False
        self.revealed = False
        self.shown: list[float] = []
        self.plays: list[bool] = []
        self.waiting: list[object] = []
        self.plotted: list[float] = []

    def reveal(self, _snapshots: object) -> None:
        self.revealed = True

    def done(self) -> list[object]:
        done, self.waiting = self.waiting, []
        return done

    def show(self, snapshots: list[object]) -> None:
        self.shown.append(snapshots[0].time_s)  # type: ignore[attr-defined]

    def tell(self, _snapshots: object, _time_s: float, plays: bool) -> None:
        self.plays.append(plays)

    def plot(self, time_s: float, *, anew: bool) -> None:
        assert not anew
        self.plotted.append(time_s)


def test_buttons_play_pause_seek_and_change_the_speed(recorded: RecordedFlight) -> None:
    from colibri.view.page.controls import Done

    page = Recorder()
    show = Show(page, [recorded], 9.0)  # type: ignore[arg-type]
    show.turn(9.0)
    page.laid_out = True
    show.turn(10.0 - PLOTTED_AFTER_S)
    assert not page.revealed  # a browser that has come draws the rest first
    show.turn(10.0)
    assert page.revealed
    show.turn(10.5)
    page.waiting = [Done("speed", "0.5x")]
    show.turn(11.0)
    page.waiting = [Done("play")]
    show.turn(11.5)
    show.turn(11.6)
    page.waiting = [Done("seek", 0.3)]
    show.turn(12.0)
    assert page.shown == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.25, 0.3], abs=0.01)
    assert page.plays == [False, True, True, True, False, False]
    assert page.plotted == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.25, 0.3], abs=0.01)


def test_a_browser_without_layout_is_not_waited_for(recorded: RecordedFlight) -> None:
    page = Recorder()
    show = Show(page, [recorded], 10.0)  # type: ignore[arg-type]
    show.turn(10.0)
    show.turn(9.9 + WAITS_S)
    assert not page.revealed
    show.turn(10.0 + WAITS_S)
    assert page.revealed


def test_an_export_needs_nothing_else(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "flight.html"
    export([folder], path)
    text = path.read_text(encoding="utf-8")
    assert "__VISER_EMBED_DATA__" in text
    assert 'src="http' not in text
    with pytest.raises(ViewError, match="cannot write"):
        export([folder], tmp_path / "missing" / "flight.html")


def test_a_flight_is_not_laid_over_itself(flight: Flight, folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ViewError, match="given twice"), ExitStack() as held:
        read_flights([folder, folder], held)
    copied = flight.save(tmp_path / folder.name)
    with ExitStack() as held:
        names = [each.name for each in read_flights([folder, copied], held)]
    assert len(set(names)) == 2
