from pathlib import Path
from typing import Any

import psutil
import pytest

import colibri
from colibri.campaigns.engines import Killed
from colibri.campaigns.flights import FlightResult
from colibri.campaigns.run import fly_campaign
from tests.support.campaigns import MASS, PATIENCE_S, SEEDS, SHORT, Here, Hovers, begin, planned, rows, tables_in


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("expected") / "out"
    campaign = planned(fly={"duration": 0.6}, seeds=SEEDS, draw={MASS: {"uniform": [0.68, 0.74]}})
    fly_campaign(campaign, Here(), folder)
    return tables_in(folder)


@pytest.mark.long
def test_it_is_interrupted_and_goes_on_though_a_worker_is_killed(tmp_path: Path, expected: tuple[str, str]) -> None:
    out = tmp_path / "out"
    with begin(out, "--workers", "1") as first:
        rows(out, 3)
        first.terminate()
        _, said = first.communicate(timeout=PATIENCE_S)
    assert first.returncode == 143
    assert said == f"colibri: error: ended by SIGTERM; finished flights are in {out}: continue with --resume\n"
    kept = rows(out, 3)
    assert kept < 40
    assert len(tables_in(out)[0].splitlines()) == kept + 1
    with begin(out, "--workers", "2", "--resume") as second:
        rows(out, kept + 3)
        children = psutil.Process(second.pid).children()
        next(child for child in children if "resource_tracker" not in " ".join(child.cmdline())).kill()
        assert second.wait(PATIENCE_S) == 0
    assert tables_in(out) == expected


@pytest.mark.long
@pytest.mark.parametrize("least", range(0, 40, 2))
def test_it_is_killed_at_any_instant_and_goes_on(tmp_path: Path, expected: tuple[str, str], least: int) -> None:
    out = tmp_path / "out"
    with begin(out, "--workers", "2") as first:
        rows(out, least)
        first.kill()
    with begin(out, "--workers", "2", "--resume") as second:
        assert second.wait(PATIENCE_S) == 0
    assert tables_in(out) == expected


def test_from_python_with_a_law_and_a_metric_of_one_s_own(tmp_path: Path) -> None:
    part = "profile.controllers.Hovers.part"
    profile = colibri.load_profile("flight").replace("controllers.Hovers", {"part": 1.0})
    flown: list[FlightResult] = []
    results = colibri.campaign(
        fly=SHORT | {"track": "hover", "profile": profile, "controller": Hovers},
        grid={part: [0.9, 1.0]},
        metrics={"sunk": lambda flight: flight.samples["z"][0] - flight.samples["z"][-1]},
        workers=1,
        progress=flown.append,
    )
    assert [each.flight for each in flown] == [0, 1]
    sunk = results.flights["sunk"]
    assert sunk[0] > sunk[1] + 0.01
    assert results.save(tmp_path / "kept") == tmp_path / "kept"
    assert tables_in(tmp_path / "kept")[0].startswith(
        f"flight,{part},seed,sunk,verdict,why,trajectory_sha256\n0,0.9,0,"
    )


def test_logs_are_kept_and_a_killed_flight_is_a_row(tmp_path: Path) -> None:
    class Kills(Here):
        def each(self, work: Any, common: Any, jobs: Any) -> Any:
            for job, result in super().each(work, common, jobs):
                yield job, Killed() if job.flight == 1 else result

    results = fly_campaign(planned(seeds="0-1", logs="all"), Kills(), tmp_path / "out")
    assert [str(each.verdict) for each in results.flown] == ["flown", "killed"]
    assert (tmp_path / "out/flights/000000/flight.csv").exists()
    assert not (tmp_path / "out/flights/000001").exists()
    last = tables_in(tmp_path / "out")[0].splitlines()[-1]
    assert ',killed,"the process that flew it was killed, and again when it flew this alone",' in last
