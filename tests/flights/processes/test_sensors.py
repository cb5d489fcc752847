"""Flights on sensors: the same over every link, another with every seed, and on the track."""

from pathlib import Path
from time import monotonic

import numpy as np
import pytest

from colibri.common.process.lifecycle import nudge_m
from colibri.sitl.backends.link_faults import Pipe, Trouble
from tools.harness.ports import Relay
from tools.harness.processes import Process, fly, running, start_autopilot, start_plant, states, topic_rows

ON_SENSORS = ("spiral", "--feedback", "sensors")


class BadLink(Relay):
    """A relay like a bad radio link, both ways; what is held back goes with a later datagram."""

    def __init__(self, plant_url: str) -> None:
        super().__init__(plant_url)
        trouble = Trouble(loss=0.2, duplicate=0.1, reorder=0.1)
        self._pipes = {to: Pipe(trouble, to) for to in ("plant", "autopilot")}

    def pass_on(self, to: str, datagram: bytes) -> None:
        now_us = round(monotonic() * 1e6)
        self._pipes[to].put(datagram, now_us)
        for each in self._pipes[to].due(now_us):
            self.deliver(to, each)


@pytest.mark.long
def test_a_bad_link_does_not_change_what_sensors_tell(tmp_path: Path) -> None:
    """20 % lost, 10 % duplicated, 10 % reordered, both ways: the flight is the one in memory, noise and all."""
    duration = ("--duration", "1.6")
    fly(tmp_path / "good", *ON_SENSORS, "--link", "memory", "--seed", "3", "--start", "x=0,y=-1,psi=90", *duration)
    hummingbird = ("--vehicle", "hummingbird", "--integrator", "rk4", "--start", "y=-1,psi=90", "--seed", "3")
    (tmp_path / "logs").mkdir()
    plant, url = start_plant(tmp_path / "logs", tmp_path / "bad", *hummingbird, *duration)
    with BadLink(url) as relay:
        autopilot = start_autopilot(
            tmp_path / "logs", relay.url, "--profile", "flight", "--track", "spiral", "--feedback", "sensors"
        )
        with running(plant, autopilot):
            ended = plant.wait_for("ended")
            assert plant.wait() == 0
    assert ended["frames"] == 400
    assert ended["resent"] > 100
    assert (states(tmp_path / "bad") == states(tmp_path / "good")).all()
    assert plant.errors() + autopilot.errors() == ""


def test_the_track_begins_once_the_estimate_is_aligned(tmp_path: Path) -> None:
    options = ("--link", "memory", "--vehicle", "hummingbird-rtk", "--duration", "24", "--seed", "1")
    figures = fly(tmp_path, *ON_SENSORS, *options)
    truth = topic_rows(tmp_path)
    assert figures["start"]["z"] == figures["start"]["rotors"] == 0.0
    first_second = truth["t"] < 1.0
    assert np.abs(truth["z"][first_second]).max() < 1e-3
    assert truth["omega1"][first_second].max() == 0.0
    assert figures["rmse_after_20s_m"] < 0.05
    assert figures["qp_failures"] == 0


def test_one_plant_serves_state_as_well_as_sensors(tmp_path: Path) -> None:
    plant = Process(tmp_path, "plant", "--link", "udpin:127.0.0.1:0", "--out", str(tmp_path / "out"), "--duration", "1")
    url = plant.wait_for("listening")["url"].replace("udpin", "udpout")
    autopilot = Process(tmp_path, "autopilot", "--plant", url)
    with running(plant, autopilot):
        assert plant.wait_for("ended")["frames"] == 250
    assert states(tmp_path / "out")[0, 7:10].tolist() == pytest.approx((nudge_m(), -1.0 + nudge_m(), 2.0))
