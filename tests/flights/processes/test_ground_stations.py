"""`colibri fly` watched by ground stations that send requests: the same flight, bit for bit."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl.vehicle import Sitl
from tools.harness.ports import OnPort
from tools.harness.processes import fly, states
from tools.soak.clients import ACCEPTED, HarnessStation

DURATION = ("--duration", "4")
WATCHED = ("HEARTBEAT", "ATTITUDE", "LOCAL_POSITION_NED", "ODOMETRY", "AUTOPILOT_VERSION", "PARAM_VALUE", "PING")


@pytest.mark.parametrize(
    ("track", "profile"),
    [
        ("lemniscate", "flight"),
        *(pytest.param(*flown, marks=pytest.mark.long) for flown in (("circle", "se3"), ("wave", "thesis"))),
    ],
)
def test_a_watched_flight_is_the_same_bit_for_bit(tmp_path: Path, track: str, profile: str) -> None:
    """It begins above its track: one that must sink is watched for the ground, but does not touch it for that."""
    options = ("--profile", profile, *DURATION, "--start", "z=4")
    alone = fly(tmp_path / "alone", track, "--link", "memory", *options)
    stations = HarnessStation(255, every=2), HarnessStation(245, every=2)
    with OnPort(stations[0]) as one, OnPort(stations[1]) as other:
        links = ("--gcs", one.url, "--gcs", other.url, "--speed", "3")
        watched = fly(tmp_path / "watched", track, *links, *options)
    for station in stations:
        assert not [name for name in WATCHED if not station.counts[name]], station.counts
        assert {ack.target for ack in station.acks} == {station.identity}
        assert {ack.result for ack in station.acks} == {ACCEPTED}
        assert {ack.command for ack in station.acks} == set(station.sent)
    assert watched["trajectory_sha256"] == alone["trajectory_sha256"]
    assert watched["rmse_m"] == alone["rmse_m"]
    assert (states(tmp_path / "alone") == states(tmp_path / "watched")).all()


def test_nothing_is_compiled_or_loaded_in_flight() -> None:
    """It would hold the vehicle up for seconds, at its first take-off of all times."""
    command = [sys.executable, "-m", "tests.flights.processes.compiled_in_flight"]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == ""


@pytest.mark.parametrize("profile", ["thesis", pytest.param("se3", marks=pytest.mark.long)])
def test_every_control_law_flies_where_it_is_sent(sitl_fleet: Callable[..., list[Sitl]], profile: str) -> None:
    """One previews a single reference, the other two that are four control samples apart."""
    (sitl,) = sitl_fleet(1, profile=profile, airborne=5.0)
    sitl.goto(3.0, 1.0, 6.0, wait=False)
    sitl.run(8.0)
    assert sitl.position == pytest.approx((3.0, 1.0, 6.0), abs=0.05)
    sitl.select(Mode.TRACK)
    sitl.run(10.0)
    assert sitl.mode is Mode.TRACK


def test_a_watched_flight_is_paced_to_the_wall_clock(tmp_path: Path) -> None:
    station = HarnessStation(255)
    with OnPort(station) as port:
        report = fly(tmp_path, "hover", "--gcs", port.url, "--duration", "1.5")
    assert station.counts["HEARTBEAT"] >= 1
    assert report["wall_time_s"] > 1.4
