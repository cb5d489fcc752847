from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, socket

import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.process import station_traffic
from colibri.autopilot.process.ground import GroundService
from colibri.autopilot.process.station_traffic import StationTraffic
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.status import Status
from colibri.mavlink.wire.dialect import Codec
from colibri.mavlink.wire.tlog import TRAFFIC, TlogWriter, decode
from colibri.plant.vehicle.description import load_vehicle

CODEC = Codec(255, 190)
BEAT = CODEC.encode("HEARTBEAT", 6, 8, 0, 0, 0, 3)
KEY = CODEC.encode("SETUP_SIGNING", 1, 1, [*(5 * b"secret" + b"--")], 0)
FAR = b"\xff" * 9


def frames(folder: Path) -> list[tuple[int, bytes]]:
    return [(each.time_us, each.frame) for each in decode((folder / TRAFFIC).read_bytes())]


def test_frames_of_station_and_plant_are_kept_without_a_key(tmp_path: Path) -> None:
    plant = TlogWriter(tmp_path / TRAFFIC, shared=True)
    traffic = StationTraffic(tmp_path, 1_000_000)
    plant.write(1, [BEAT])
    traffic.write(5, [BEAT + BEAT, KEY + BEAT, b"", FAR, BEAT[:-1], BEAT + FAR])
    traffic.write(9, [])
    traffic.close()
    plant.close()
    assert sorted(frames(tmp_path)) == [(1, BEAT)] + 4 * [(1_000_005, BEAT)]
    assert b"secret" not in (tmp_path / TRAFFIC).read_bytes()


def test_a_flood_does_not_fill_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(station_traffic, "MAX_BYTES", 3 * len(BEAT))
    traffic = StationTraffic(tmp_path, 0)
    for _ in range(100):
        traffic.write(1, [BEAT])
    traffic.close()
    assert len(frames(tmp_path)) == 3


def test_a_message_before_the_first_estimate_is_kept(tmp_path: Path) -> None:
    with socket(AF_INET, SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        place = free.getsockname()
    spec = AutopilotSpec(plant="", out=tmp_path, state=tmp_path, tlog=True, gcs=(f"udpin:{place[0]}:{place[1]}",))
    status = Status("autopilot", as_json=False)
    ground = GroundService(spec, load_profile("flight"), load_vehicle("hummingbird"), status)
    ground.copter.wait(8000)
    with socket(AF_INET, SOCK_DGRAM) as station:
        station.sendto(BEAT, place)
        ground.serve(0.0)
    ground.close()
    assert [frame for time_us, frame in frames(tmp_path) if time_us == spec.boot_unix_us + 8000] == [BEAT]
