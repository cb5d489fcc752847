"""`colibri compare --seeds`: the same flights by many seeds."""

import csv
from pathlib import Path

import pytest

from colibri.analysis.estimation import MEASURED
from colibri.autopilot.estimation.measurements.table import kinds_of
from colibri.cli.main import main
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import provenance_of
from colibri.plant.vehicle.description import load_vehicle
from colibri.studies import seeds
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
    assert "has flights by other settings" in capsys.readouterr().err


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
