"""`colibri compare --seeds`: the same flights by many seeds."""

import csv
import re
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from colibri.analysis.estimation import MEASURED
from colibri.autopilot.estimation.measurements.table import kinds_of
from colibri.cli.main import main
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import provenance_of
from colibri.plant.vehicle.description import load_vehicle
from colibri.studies import seed_figures, seeds
from colibri.studies.seed_log import INNOVATIONS, QUANTITIES, Flown, kept_flights

_SENSORS = load_vehicle("hummingbird").sensors
assert _SENSORS is not None
MEASURED_HERE = kinds_of(_SENSORS)


def test_flights_by_seeds_become_a_table_and_a_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = (
        "--profile",
        "flight",
        "--feedback",
        "sensors",
        "--seeds",
        "1-2",
        "--track",
        "hover",
        "--duration",
        "22",
        "--out",
        str(tmp_path),
    )
    assert main(["compare", *options]) == 0
    with (tmp_path / "seeds-flights.csv").open(encoding="utf-8", newline="") as file:
        flights = list(csv.DictReader(file))
    assert [flight["seed"] for flight in flights] == ["1", "2"]
    assert len({flight["trajectory_sha256"] for flight in flights}) == 2
    for flight in flights:
        assert flight["lost"] == ""
        assert all(0.0 < float(flight[quantity]) < 50.0 for quantity in set(QUANTITIES) - set(INNOVATIONS))
        assert float(flight["control"]) < float(flight["true"])
        assert all(0.4 < float(flight[f"nis {kind}"]) < 2.0 for kind in MEASURED_HERE)  # of 20 innovations and more
    table = (tmp_path / "seeds.md").read_text(encoding="utf-8")
    assert "| flight | hover | 2 | 0 |" in table
    assert (tmp_path / "seeds.png").stat().st_size > 10_000
    assert "hover" in capsys.readouterr().out


def test_a_vehicle_has_some_of_the_kinds_in_their_order() -> None:
    assert [kind for kind in MEASURED if kind in MEASURED_HERE] == MEASURED_HERE
    assert tuple(f"nis {kind}" for kind in MEASURED) == INNOVATIONS


def test_what_is_there_is_not_flown_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def contents(seed: int) -> str:
        options = {"track": "hover", "profile": "flight", "seed": seed, "link": "memory", "duration": 22.0}
        return provenance_of(FlightPlan.of_options(tmp_path, **options)).sha256["all"]

    values = tuple(0.1 * number for number in range(len(QUANTITIES)))
    kept = [
        Flown("flight", "hover", seed, "", values, tuple(range(len(MEASURED))), f"hash {seed}", contents(seed))
        for seed in (1, 2)
    ]
    options = [
        "compare",
        "--quiet",
        "--profile",
        "flight",
        "--track",
        "hover",
        "--seeds",
        "1-2",
        "--duration",
        "22",
        "--out",
        str(tmp_path),
    ]

    def fly_none(_work: object, jobs: list[object], *_: object, **__: object) -> list[object]:
        assert not jobs
        return []

    monkeypatch.setattr(seeds, "side_by_side", lambda *args, **_: [kept[job.seed - 1] for job in args[1]])
    assert main(options) == 0
    monkeypatch.setattr(seeds, "side_by_side", fly_none)
    assert main([*options, "--resume"]) == 0
    assert list(kept_flights(tmp_path, (tmp_path / "seeds-settings.txt").read_text().strip()).values()) == kept
    with pytest.raises(SystemExit) as end:
        main([*options, "--resume", "--wind", "5@270"])
    assert end.value.code == 2
    assert re.search(r"has flights by other settings \([a-z_]+=[^ ]+, now [^ ]+\): give", capsys.readouterr().err)


def test_a_vehicle_that_is_lost_is_counted_and_ends_in_exit_code_1(tmp_path: Path) -> None:
    """The thesis's profile tips over on what is flown so briskly."""
    options = (
        "--seeds",
        "1",
        "--profile",
        "thesis",
        "--track",
        "lemniscate",
        "--duration",
        "30",
        "--out",
        str(tmp_path),
    )
    assert main(["compare", "--quiet", *options]) == 1
    with (tmp_path / "seeds-flights.csv").open(encoding="utf-8", newline="") as file:
        (flight,) = csv.DictReader(file)
    assert flight["lost"]


@pytest.mark.parametrize("seeds", ["5-1", "one", "1-two", ""])
def test_bad_seeds_are_one_line(seeds: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["compare", f"--seeds={seeds}"])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert f"argument --seeds: expected FIRST-LAST, 1-50 say, not {seeds}" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("estimated", [True, False])
def test_the_figure_has_room_for_its_rows_and_a_dot_for_each_flight(
    estimated: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(seed_figures, "write_figure", lambda figure, _path: drawn.append(figure))
    values = tuple(0.1 + number if estimated or number < 2 else float("nan") for number in range(len(QUANTITIES)))
    counts = tuple(range(len(MEASURED)))
    names = ("my-longest-profile.toml:geometric-se3", "flight")
    seed_figures.draw_seeds(
        [Flown(name, "circle:radius=3,speed=4", seed, "", values, counts, "", "") for name in names for seed in (1, 2)],
        Path(),
    )
    (figure,) = drawn
    figure.draw_without_rendering()
    assert min(text.get_window_extent().x0 for axes in figure.axes for text in axes.get_yticklabels()) > 0.0
    assert max(axes.xaxis.label.get_window_extent().x1 for axes in figure.axes) < figure.bbox.width
    dots = sum(line.get_marker() == "o" for line in figure.axes[0].lines)
    assert dots == len(names) * (2 if estimated else 1)


def test_what_changed_since_is_flown_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A profile's contents count, not its name; the options are the same."""

    def one_by_one(work: Any, jobs: list[Any], *_: object, keep: Any, **__: object) -> list[Flown]:
        flown = [work(job) for job in jobs]
        for each in flown:
            keep(each)
        return flown

    monkeypatch.setattr(seeds, "side_by_side", one_by_one)
    profile, out = tmp_path / "mine.toml", tmp_path / "out"
    assert main(["show", "profile", "flight"]) == 0
    text = capsys.readouterr().out
    profile.write_text(text, encoding="utf-8")
    command = ["compare", "--profile", str(profile), "--track", "hover", "--seeds", "1-2", "--duration", "0.5"]

    def hashes(*options: str) -> list[str]:
        assert main([*command, "--out", str(out), *options]) == 0
        with (out / "seeds-flights.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert {row["profile"] for row in rows} == {"mine"}
        return [row["trajectory_sha256"] for row in rows]

    first = hashes()
    assert hashes("--resume") == first
    said = capsys.readouterr().out
    assert "again" not in said
    assert "control" in said
    assert "NEES" not in said, "nothing is estimated"
    assert max(map(len, said.splitlines()[1:])) <= 80
    profile.write_text("# a remark\n" + text.replace("poles = [-5.0, -6.0]", "poles = [-4.0, -6.0]"), encoding="utf-8")
    assert set(hashes("--resume")).isdisjoint(first)
    assert "--resume: 2 of 2 flights are flown again, by contents that changed\n" in capsys.readouterr().out
