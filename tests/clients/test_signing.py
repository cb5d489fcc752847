"""Message signing between the vehicle and a ground station of pymavlink, end to end."""

from pathlib import Path
from time import time

import pytest
from pymavlink.dialects.v20 import development as mavlink2

from tests.clients.support.ground_station import GroundStation
from tools.harness.processes import vehicle, wait_for

KEY = bytes(range(1, 33))
ACCEPTED = mavlink2.MAV_RESULT_ACCEPTED
SPEED = mavlink2.MAV_CMD_DO_CHANGE_SPEED
EPOCH_S = 1_420_070_400


def sign(station: GroundStation, key: bytes = KEY) -> None:
    """Sign what the station sends, and believe only what is signed."""
    signing = station.mav.signing
    signing.secret_key = key
    signing.link_id = 3
    signing.timestamp = round((time() - EPOCH_S) * 1e5)
    signing.sign_outgoing = True
    signing.allow_unsigned_callback = None


def change_speed(station: GroundStation) -> int:
    return station.command(SPEED, 1, 3.0, -1, 0, 0, 0, 0)


def command(station: GroundStation) -> bytes:
    frame: bytes = station.mav.command_long_encode(1, 1, SPEED, 0, 1, 3.0, -1, 0, 0, 0, 0).pack(station.mav)
    return frame


def refuses(station: GroundStation, frame: bytes) -> bool:
    """Whether a command gets no answer, while the vehicle is heard for three seconds of its heartbeats."""
    before = len(station.heard)
    station.write(frame)
    for _ in range(3):
        station.wait("HEARTBEAT", lambda beat: beat.get_srcSystem() == 1)
    return not any(message.get_type() == "COMMAND_ACK" for message in station.heard[before:])


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "key"
    path.write_text(KEY.hex() + "\n", encoding="ascii")
    path.chmod(0o600)
    return path


@pytest.mark.long
def test_unsigned_badly_signed_and_replayed_frames_are_refused(tmp_path: Path, key_file: Path) -> None:
    with GroundStation(announced=False) as station:
        sign(station)
        with vehicle(tmp_path, "--signing-key", str(key_file), links=(station.url,), speed=4.0):
            assert station.wait("HEARTBEAT").get_signed()
            sent: list[bytes] = []
            station.listen_to_sent(sent.append)
            assert change_speed(station) == ACCEPTED
            (frame,) = sent

            assert refuses(station, frame)
            station.mav.signing.sign_outgoing = False
            assert refuses(station, command(station))
            station.mav.signing.sign_outgoing = True
            right, station.mav.signing.secret_key = station.mav.signing.secret_key, bytes(32 * [7])
            station.mav.signing.allow_unsigned_callback = lambda *_: True
            wrong = command(station)
            station.mav.signing.secret_key = right
            assert refuses(station, wrong)
            assert change_speed(station) == ACCEPTED


@pytest.mark.long
def test_a_key_is_set_over_loopback_and_outlives_a_restart(tmp_path: Path) -> None:
    with GroundStation() as station:
        with vehicle(tmp_path, links=(station.url,), speed=4.0) as flown:
            folder = flown.state / "0"
            station.wait("HEARTBEAT")
            assert change_speed(station) == ACCEPTED
            ahead = round((time() - EPOCH_S + 20.0) * 1e5)
            station.mav.setup_signing_send(1, 1, KEY, ahead)
            assert refuses(station, command(station))
            sign(station)
            station.mav.signing.timestamp = ahead
            assert change_speed(station) == ACCEPTED
            wait_for((folder / "signing.key").exists, "the key")
            assert (folder / "signing.key").read_bytes() == KEY
            assert (folder / "signing.key").stat().st_mode & 0o077 == 0
            assert flown.end() == 0
        kept = int((folder / "signing.timestamp").read_text(encoding="ascii"))
        assert kept > ahead

        station.peers.clear()
        with vehicle(tmp_path, links=(station.url,), speed=4.0):
            beat = station.wait("HEARTBEAT")
            assert beat.get_signed()
            assert int.from_bytes(beat.get_msgbuf()[-12:-6], "little") > kept
            station.mav.signing.timestamp = max(station.mav.signing.timestamp, kept)
            assert change_speed(station) == ACCEPTED
