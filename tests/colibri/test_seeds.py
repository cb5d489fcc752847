import csv
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from colibri.analysis.estimation import MEASURED
from colibri.autopilot.estimation.measurements.table import kinds_of
from colibri.campaigns.definition import CampaignTables, campaign_of
from colibri.campaigns.engines import Pool
from colibri.campaigns.factors import shown
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.cli.main import main
from colibri.plant.vehicle.description import load_vehicle
from colibri.studies import seed_figures
from colibri.studies.comparison import SEED_METRICS
from tests.support.campaigns import Here
from tests.support.commands import FLIGHT, Ran, Refused

_SENSORS = load_vehicle("hummingbird").sensors
assert _SENSORS is not None
MEASURED_HERE = kinds_of(_SENSORS)


def test_flights_by_seeds_become_a_table_and_a_figure(
    tmp_path: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Pool, "each", Here().each)
    options = ["--profile", "flight", "--feedback", "sensors", "--seeds", "1-2", "--track", "hover", "--duration", "21"]
    assert "hover" in ran("compare", *options, "--out", tmp_path).out
    with (tmp_path / "seeds-flights.csv").open(encoding="utf-8", newline="") as file:
        flights = list(csv.DictReader(file))
    assert [flight["seed"] for flight in flights] == ["1", "2"]
    assert len({flight["trajectory_sha256"] for flight in flights}) == 2
    for flight in flights:
        assert (flight["verdict"], flight["why"]) == ("flown", "")
        errors = [metric.name for metric in SEED_METRICS if not metric.name.startswith("nis_mean.")]
        assert all(0.0 < float(flight[name]) < 50.0 for name in errors)
        assert float(flight["control_rmse_m"]) < float(flight["rmse_after_20s_m"])
        assert all(float(flight[f"nis_mean.{kind}.innovations"]) > 0.0 for kind in MEASURED_HERE)
        assert all(0.4 < float(flight[f"nis_mean.{kind}.mean"]) < 2.0 for kind in MEASURED_HERE)
    table = (tmp_path / "seeds.md").read_text(encoding="utf-8")
    assert "| flight | hover | 2 | 0 |" in table
    assert (tmp_path / "seeds.png").stat().st_size > 10_000


def test_a_vehicle_has_some_of_the_kinds_in_their_order() -> None:
    assert [kind for kind in MEASURED if kind in MEASURED_HERE] == MEASURED_HERE
    assert {f"nis_mean.{kind}.mean" for kind in MEASURED} <= {metric.name for metric in SEED_METRICS}


def test_what_is_there_is_not_flown_again(
    tmp_path: Path, ran: Ran, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["compare", "--profile", "flight", "--track", "hover", "--duration", "0.5", "--out", str(tmp_path)]

    def fly_none(_pool: Pool, _work: object, _common: object, jobs: Iterable[object]) -> Iterator[object]:
        assert not list(jobs)
        yield from ()

    monkeypatch.setattr(Pool, "each", Here().each)
    assert main([*command, "--quiet", "--seeds", "1-2"]) == 0
    flown = (tmp_path / "seeds-flights.csv").read_text(encoding="utf-8")
    journal = (tmp_path / "seeds-journal.jsonl").read_bytes()
    (tmp_path / "seeds-journal.jsonl").write_bytes(journal[:-1])  # killed while it wrote
    options = [*command, "--seeds", "1-2", "--resume"]
    assert "--resume: 1 of 2 flights were flown already, by the same contents\n" in ran(*options).out
    monkeypatch.setattr(Pool, "each", fly_none)
    assert "--resume: 2 of 2 flights were flown already, by the same contents\n" in ran(*options).out
    assert (tmp_path / "seeds-flights.csv").read_text(encoding="utf-8") == flown
    assert main([*command, "--seeds", "2-2", "--resume"]) == 0
    assert (tmp_path / "seeds.csv").read_text(encoding="utf-8").splitlines()[1].startswith("flight,hover,1,0,")
    line = r"--resume: .* has flights by other settings \([a-z_]+=[^ ]+, now [^ ]+\): give another --out"
    assert re.fullmatch(line, refused(*options, "--wind", "5@270"))


def test_a_lost_vehicle_is_counted_and_exits_with_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thesis's profile tips over on what is flown so briskly."""
    monkeypatch.setattr(Pool, "each", Here().each)
    options = ["--seeds", "1", "--profile", "thesis", "--track", "lemniscate", "--duration", "30", "--quiet"]
    assert main(["compare", *options, "--out", str(tmp_path)]) == 1
    with (tmp_path / "seeds-flights.csv").open(encoding="utf-8", newline="") as file:
        (flight,) = csv.DictReader(file)
    assert flight["verdict"] == "lost"
    assert "off its track" in flight["why"]


@pytest.mark.parametrize("estimated", [True, False])
def test_the_figure_has_a_dot_for_each_flight(estimated: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(seed_figures, "write_figure", lambda figure, _path: drawn.append(figure))
    values = tuple(0.1 + number if estimated or number < 2 else None for number in range(len(SEED_METRICS)))
    names = ("my-longest-profile.toml:geometric-se3", "flight")
    grid = {"contender": {name: {"profile": "flight"} for name in names}, "track": ["circle:radius=3,speed=4"]}
    planned = campaign_of(CampaignTables(seeds="1-2", grid=grid, metrics=SEED_METRICS))
    verdicts = {names[0]: Verdict.LOST, names[1]: Verdict.FLOWN}
    flown = {
        point.flight: FlightResult(point.flight, verdicts[shown(point.factors["contender"])], "", values, "")
        for point in planned.points()
    }
    seed_figures.draw_seeds(FlightTable(planned, flown), Path())
    (figure,) = drawn
    figure.draw_without_rendering()
    assert min(text.get_window_extent().x0 for axes in figure.axes for text in axes.get_yticklabels()) > 0.0
    assert max(axes.xaxis.label.get_window_extent().x1 for axes in figure.axes) < figure.bbox.width
    dots = sum(line.get_marker() == "o" for line in figure.axes[0].lines)
    assert dots == (2 if estimated else 1), "of those that came through"
    assert [text.get_text() for text in figure.axes[0].texts] == ["2 lost"]


def test_what_changed_since_is_flown_again(tmp_path: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    """A profile's contents count, not its name; the options are the same."""
    monkeypatch.setattr(Pool, "each", Here().each)
    profile, out = tmp_path / "mine.toml", tmp_path / "out"
    text = FLIGHT.read_text(encoding="utf-8")
    profile.write_text(text, encoding="utf-8")
    flight = ["--track", "hover", "--start", "x=1", "--seeds", "1-2", "--duration", "0.5"]

    def flown(*options: str) -> tuple[str, list[str]]:
        said = ran("compare", "--profile", profile, *flight, "--out", out, *options).out
        with (out / "seeds-flights.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert {row["contender"] for row in rows} == {"mine"}
        return said, [row["trajectory_sha256"] for row in rows]

    _, first = flown()
    said, again = flown("--resume")
    assert again == first
    assert "--resume: 2 of 2 flights were flown already" in said
    assert "control" in said
    assert "NEES" not in said, "nothing is estimated"
    assert max(map(len, said.splitlines()[2:])) <= 80
    profile.write_text(
        "# a remark\n" + text.replace("\npoles = [-7.0, -8.0]", "\npoles = [-6.0, -8.0]"), encoding="utf-8"
    )
    said, anew = flown("--resume")
    assert set(anew).isdisjoint(first)
    assert "--resume: 0 of 2 flights were flown already, by the same contents\n" in said
