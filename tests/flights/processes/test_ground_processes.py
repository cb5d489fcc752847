"""Plant, autopilot and ground stations as processes: what dies, falls asleep or vanishes ends no flight."""

import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import Codec, mav
from tools.harness.observer import Observer, Sight
from tools.harness.processes import Process, running, wait_for

HIGH = ("--vehicle", "hummingbird", "--start", "y=0,z=3,psi=90,rotors=4740")
SPEED = 2.0
PLACE = (0.0, 0.0, 3.0)
MIN_PERIOD_US = 1_000
STREAMS = ("ATTITUDE", "ATTITUDE_QUATERNION", "ODOMETRY", "HIGHRES_IMU", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
CODEC = Codec(255, 190)
HEARTBEAT = CODEC.encode("HEARTBEAT", 6, 8, 0, 0, 4, 3)


@contextmanager
def hovering(logs: Path, *links: str) -> Iterator[tuple[Process, Process, Observer, str]]:
    plant = Process(logs, "plant", "--link", "udpin:127.0.0.1:0", "--speed", repr(SPEED), *HIGH)
    with Observer() as seen, running(plant):
        url = plant.wait_for("listening")["url"].replace("udpin", "udpout")
        autopilot = start(logs, url, seen, *links)
        with running(autopilot):
            seen.wait(lambda sight: sight.time_s > 1.0, "the vehicle")
            yield plant, autopilot, seen, url


def start(logs: Path, url: str, seen: Observer, *links: str) -> Process:
    return Process(logs, "autopilot", "--plant", url, *(f"--gcs={link}" for link in (*links, seen.url)))


def hovers(sight: Sight) -> bool:
    away_m = max(abs(is_at - was_at) for is_at, was_at in zip(sight.position_enu_m, PLACE, strict=True))
    return sight.mode is Mode.HOLD and sight.armed and away_m < 0.05


def flies_on(seen: Observer, seconds: float) -> None:
    until_s = seen.now.time_s + seconds
    seen.wait(lambda sight: sight.time_s > until_s, f"{seconds} s of flight")
    assert all(map(hovers, seen.sights)), seen.now


def test_an_autopilot_that_was_killed_is_started_again_and_holds(logs: Path) -> None:
    with hovering(logs) as (plant, first, seen, url):
        first.process.send_signal(signal.SIGKILL)
        first.wait()
        assert "waiting for the autopilot" in plant.wait_for("silence")["text"]
        before_s = seen.now.time_s
        second = start(logs, url, seen)
        with running(second):
            seen.wait(lambda sight: sight.time_s > before_s, "the vehicle again")
            plant.wait_for("answered")
            flies_on(seen, 1.0)


@pytest.mark.long
def test_clients_that_fall_asleep_or_vanish_are_nobodys_trouble(logs: Path) -> None:
    with hovering(logs, "tcpin:127.0.0.1:0") as (_, autopilot, seen, _):
        (url,) = (each["url"] for each in autopilot.events("ground") if each["url"].startswith("tcpin"))
        port = int(url.rpartition(":")[2])
        asleep, vanishing = (caller(port) for _ in range(2))
        for client in (asleep, vanishing):
            for name in STREAMS:
                number = getattr(mav, f"MAVLINK_MSG_ID_{name}")
                wish = (1, 1, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, number, MIN_PERIOD_US, 0, 0, 0, 0, 0)
                client.sendall(CODEC.encode("COMMAND_LONG", *wish))
        heard = b""
        while len(heard) < 10_000:
            heard += vanishing.recv(4096)
        vanishing.close()
        flies_on(seen, 3.0)
        wait_for(lambda: not connected(autopilot, 2), "the connection to be forgotten")
        asleep.close()
        wait_for(lambda: not connected(autopilot, 1), "the other connection to be forgotten")
        assert autopilot.errors() == ""


def caller(port: int) -> socket.socket:
    """Call, with little room for what is not read."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    sock.connect(("127.0.0.1", port))
    sock.sendall(HEARTBEAT)
    return sock


def connected(autopilot: Process, how_many: int) -> bool:
    status = autopilot.events("status")[-1]
    return any(len(link["heard"]) >= how_many for link in status["links"] if link["url"].startswith("tcpin"))
