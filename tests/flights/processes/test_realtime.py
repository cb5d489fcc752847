"""A plant that waits for nobody: it flies by the wall clock, stops its rotors in silence, and is picked up again."""

import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from colibri.common.process.status import Status
from colibri.plant.process.reports import Silence
from tools.harness.processes import Process, running, topic_rows, wait_for

HIGH = ("--start", "z=500,psi=0,rotors=4740")


def start(logs: Path, out: Path, *options: str) -> tuple[Process, str]:
    plant = Process(logs, "plant", "--realtime", "--link", "udpin:127.0.0.1:0", "--out", str(out), *HIGH, *options)
    url: str = plant.wait_for("listening")["url"]
    return plant, url.replace("udpin", "udpout")


def autopilot_for(logs: Path, url: str) -> Process:
    return Process(logs, "autopilot", "--plant", url, "--track", "hover:height=500")


def flown_on(plant: Process, seconds: float) -> Callable[[], bool]:
    since: dict[int, float] = {}

    def has() -> bool:
        silences, now_s = len(plant.events("silence")), plant.events("progress")[-1]["sim_time_s"]
        return bool(now_s - since.setdefault(silences, now_s) > seconds)

    return has


def test_rotors_stop_with_a_dead_autopilot_until_the_next(tmp_path: Path, logs: Path) -> None:
    out = tmp_path / "flight"
    plant, url = start(logs, out, "--cut-after", "0.3")
    first = autopilot_for(logs, url)
    with running(plant, first):
        first.wait_for("flying")
        wait_for(
            lambda: any(event["sim_time_s"] > 0.5 for event in plant.events("progress")), "half a second of flight"
        )
        first.process.send_signal(signal.SIGKILL)
        first.wait()
        cuts = len(plant.events("silence"))
        wait_for(lambda: len(plant.events("silence")) > cuts, "the rotors to be stopped")
        assert "the rotors are stopped" in plant.wait_for("silence")["text"]
        second = autopilot_for(logs, url)
        with running(second):
            answered = len(plant.events("answered"))
            wait_for(lambda: len(plant.events("answered")) > answered, "an answer")
            wait_for(flown_on(plant, 0.5), "half a second without another silence")
            plant.process.send_signal(signal.SIGINT)
            assert plant.wait() == 130
    truth = topic_rows(out)
    assert np.diff(truth["t"]) == pytest.approx(0.004)
    rotors = np.max([truth[f"omega{number}"] for number in range(1, 5)], axis=0)
    assert rotors.min() < 0.2 * rotors[0]
    assert rotors[np.argmin(rotors) :].max() > 0.5 * rotors[0]


def test_silence_is_reported_once_each_time(capsys: pytest.CaptureFixture[str]) -> None:
    silence = Silence(Status("plant", as_json=False), 0.5, "back", 0.0)
    assert not silence.lasts(0.4, "no command", 0, "")
    assert silence.lasts(0.5, "no command", 500_000, ", waiting")
    assert not silence.lasts(0.6, "no command", 0, "")
    silence.end(0.65)
    silence.end(0.66)
    assert not silence.lasts(1.1, "no command", 0, "")
    assert silence.lasts(1.2, "no command", 1_200_000, "")
    lines = ["no command at t = 0.500 s, waiting", "back", "no command at t = 1.200 s"]
    assert capsys.readouterr().err == "".join(f"plant: {line}\n" for line in lines)
