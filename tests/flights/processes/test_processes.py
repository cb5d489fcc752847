"""Plant and autopilot as processes: bad links, deaths, restarts, either order."""

import signal
from pathlib import Path

import pytest

from tools.harness.processes import THESIS_PLANT, Process, fly_thesis, running, start_autopilot, start_plant, states


@pytest.mark.long
def test_the_autopilot_may_start_first(tmp_path: Path, logs: Path) -> None:
    free, url = start_plant(logs, tmp_path / "unused")
    free.kill()
    autopilot = start_autopilot(logs, url)
    with running(autopilot):
        autopilot.wait_for("calling")
        link = ("--link", url.replace("udpout", "udpin"))
        plant = Process(logs, "plant", *link, *THESIS_PLANT, "--duration", "5")
        with running(plant):
            assert plant.wait_for("ended")["frames"] == 50
            assert plant.wait() == 0


@pytest.mark.long
def test_a_killed_plant_is_missed_and_replaced(tmp_path: Path, logs: Path) -> None:
    first, url = start_plant(logs, tmp_path / "first")
    autopilot = start_autopilot(logs, url)
    with running(first, autopilot):
        first.wait_for("progress")
        first.process.send_signal(signal.SIGKILL)
        first.wait()
        assert "waiting for a plant" in autopilot.wait_for("silence")["text"]
        link = ("--link", url.replace("udpout", "udpin"))
        out = ("--out", str(tmp_path / "second"))
        second = Process(logs, "plant", *link, *THESIS_PLANT, "--duration", "10", *out)
        with running(second):
            assert second.wait_for("ended")["frames"] == 100
    fly_thesis(tmp_path / "alone", "spiral", "--link", "memory", "--duration", "10")
    assert (states(tmp_path / "second") == states(tmp_path / "alone")).all()


@pytest.mark.long
def test_an_autopilot_at_another_rate_is_told(tmp_path: Path, logs: Path) -> None:
    profile = tmp_path / "slow.toml"
    text = (Path(__file__).parents[3] / "autopilot" / "profiles" / "thesis.toml").read_text(encoding="utf-8")
    profile.write_text(text.replace("control_interval_s = 0.1", "control_interval_s = 0.2"), encoding="utf-8")
    plant, url = start_plant(logs, tmp_path / "flight", "--speed", "1")
    first = start_autopilot(logs, url)
    with running(plant, first):
        first.wait_for("flying")
        first.kill()
        second = start_autopilot(logs, url, "--profile", str(profile))
        with running(second):
            assert "another frame rate" in second.wait_for("refused")["text"]
