"""`colibri bench`: what it says and writes; no test asserts how fast anything is."""

import json
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.qp import installed_solvers
from colibri.bench import costs, run, speed, stages
from colibri.cli.main import main

SHORT_S = "0.2"


def figures_of(out: Path, *options: str) -> dict[str, Any]:
    assert main(["bench", "--runs", "1", "--duration", SHORT_S, "--out", str(out), *options]) == 0
    figures: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return figures


@pytest.fixture(
    scope="module", params=[[stages.PROFILE_HORIZON], pytest.param([*stages.BLOCKS], marks=pytest.mark.long)]
)
def chosen(request: pytest.FixtureRequest) -> list[int]:
    """Horizons; each has kernels of its own."""
    return list(request.param)


@pytest.fixture(scope="module")
def measured(chosen: list[int], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "BLOCKS", {horizon: stages.BLOCKS[horizon] for horizon in chosen})
        return figures_of(tmp_path_factory.mktemp("bench") / "stages.json", "--only", "stages")


def test_every_stage_takes_time_at_every_horizon(chosen: list[int], measured: dict[str, Any]) -> None:
    assert set(measured) == {"settings", "stages"}
    horizons = measured["stages"]["horizons"]
    assert [int(horizon) for horizon in horizons] == chosen
    for horizon, figures in horizons.items():
        assert sum(figures["blocks"]) == int(horizon)
        assert set(figures["us"]) == {stage.name for stage in stages.STAGES}
        assert all(0.0 < figure["p50"] <= figure["p99"] for figure in figures["us"].values())
        assert {figure["samples"] for figure in figures["us"].values()} == {24}


def test_every_installed_solver_solves_the_qps_of_the_flight(measured: dict[str, Any]) -> None:
    for solvers in measured["stages"]["solvers"].values():
        assert set(solvers) == set(installed_solvers())
        assert all(figure["p50"] > 0.0 for figure in solvers.values())
        assert solvers["daqp"]["solved"] == 1.0
    link = measured["stages"]["link"]
    assert set(link) == {*(stage.name for stage in stages.LINK_STAGES), stages.EXCHANGE}
    assert all(figure["p50"] > 0.0 for figure in link.values())
    assert not [stage for stage in stages.STAGES if getattr(stage.owner, stage.method).__name__ == "timed"]


def test_flights_are_measured_at_every_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "real_time_factor", lambda *_: 1.0)
    flights = figures_of(tmp_path / "flights.json", "--only", "flights")["flights"]
    assert {int(frames_hz) for frames_hz in flights["rates_hz"]} == set(speed.CONTROL_S)
    assert all(set(rate) == {"memory", "udp"} for rate in flights["rates_hz"].values())


@pytest.mark.long
def test_whole_commands_alternate_with_another_checkout(tmp_path: Path) -> None:
    """The other is this one: the same program, so a ratio of two runs of it."""
    other = tmp_path / "other" / ".venv" / "bin" / "colibri"
    other.parent.mkdir(parents=True)
    other.write_text(f'#!/bin/sh\nexec {sys.executable} -m colibri "$@"\n')
    other.chmod(0o700)
    options = ("--only", "commands", "--against", str(tmp_path / "other"), "--duration", "2")
    figures = figures_of(tmp_path / "speed.json", *options)["commands"]
    assert len(figures) == len(speed.GOALS)
    for figure in figures.values():
        assert 0.0 < figure["min"] <= figure["median"] <= figure["max"]
        assert figure["ratio"] == pytest.approx(figure["median"] / figure["other"])


@pytest.mark.long
def test_the_cost_of_serving_stations_is_measured(tmp_path: Path) -> None:
    ground = figures_of(tmp_path / "ground.json", "--only", "ground")["ground"]
    assert {int(channels) for channels in ground["serve"]} == set(costs.CHANNELS)
    rates = [figure["messages_hz"] for figure in ground["serve"].values()]
    assert rates[0] == 0.0
    assert rates == sorted(set(rates))
    assert all(0.0 < figure["p50"] <= figure["p99"] for figure in ground["serve"].values())
    steps = ground["control_step_us"]
    assert set(steps) == {costs.ALONE, costs.WATCHED}
    assert {figure["samples"] for figure in steps.values()} == {24}


@pytest.mark.long
def test_the_estimator_and_sensor_flights_are_timed(tmp_path: Path) -> None:
    sensors = figures_of(tmp_path / "sensors.json", "--only", "sensors")["sensors"]
    assert set(sensors["estimator_us"]) == {costs.ALWAYS, costs.IN_FLIGHT}
    assert all(0.0 < figure["p50"] <= figure["p99"] for figure in sensors["estimator_us"].values())
    assert {figure["samples"] for figure in sensors["estimator_us"].values()} == {500}
    assert set(sensors["real_time_factor"]) == {"memory, state", "memory, sensors", "udp, state", "udp, sensors"}


def test_the_plant_is_timed_as_a_simulator_of_others(tmp_path: Path) -> None:
    exchanges = figures_of(tmp_path / "simulators.json", "--only", "simulators")["simulators"]["exchange_us"]
    assert len(exchanges) == len(costs.VEHICLES) * len(costs.AIR)
    for name, figure in exchanges.items():
        frames_hz = costs.FRAMES_HZ[name.partition(",")[0]]
        assert 0.0 < figure["p50"] <= figure["p99"]
        assert figure["samples"] == pytest.approx(float(SHORT_S) * frames_hz, abs=110)


def test_a_peer_is_measured_at_every_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "real_time_factor", lambda *_: 1.0)
    profile, peer = load_profile(run.PROFILE), speed.PeerSimulator("rotorpy", lambda *_: 2.0)
    figures = speed.rate_figures(profile, tmp_path, 0.1, 2, lambda _what: None, peer)
    assert all(rate["udp / rotorpy"]["median"] == 0.5 for rate in figures["rates_hz"].values())


def test_the_flight_profile_is_measured_at_its_own_horizon() -> None:
    blocks = load_profile(run.PROFILE).table("lpv-mpc")["plan"]["blocks"]
    assert tuple(msgspec.convert(blocks, list[int])) == stages.BLOCKS[stages.PROFILE_HORIZON]
