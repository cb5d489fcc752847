import shutil
import signal
from pathlib import Path

import msgspec
import numpy as np
import pytest
from pyulog import ULog

from colibri.analysis.recording import read_recording
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.process.recorded_inputs import read_inputs
from colibri.flights.replay import replay_flight
from colibri.mavlink.ulog.flight_topics import COMMAND
from colibri.mavlink.ulog.inputs import RecordKind, encode_input
from colibri.mavlink.ulog.log import beginning
from colibri.mavlink.ulog.reader import FlightFile
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.tlog import decode
from tests.support.commands import Ran, Refused
from tools.harness.observer import Observer
from tools.harness.processes import Process, fly, running

ROOT = Path(__file__).parents[2]
CHANGED_US = 1_000_000
BOOT_UNIX_US = 1_800_000_000_000_000
BEGINNING = beginning("Test", {})


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("flight")
    fly(out, "spiral", "--link", "memory", "--duration", "2")
    return out


@pytest.fixture
def copy(flight: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(flight, tmp_path / "flight"))


def test_a_flight_is_replayed(flight: Path, ran: Ran) -> None:
    for named in (flight / "flight.ulg", flight):
        assert ran("replay", named).out == "500 commands up to t = 1.996 s, all identical\n"


def test_a_flight_is_replayed_by_what_it_was_wherever_it_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran
) -> None:
    """Profile, vehicle and waypoints are relative, and are others by then."""
    monkeypatch.chdir(tmp_path)
    for folder, name in (("autopilot/profiles", "flight"), ("plant/vehicle/models", "hummingbird")):
        shutil.copy(ROOT / folder / f"{name}.toml", f"my-{name}.toml")
    Path("points.csv").write_text("x,y,z\n0,0,1\n2,0,2\n", encoding="utf-8")
    files = ("--profile", "my-flight.toml", "--vehicle", "./my-hummingbird.toml")
    fly(Path("out"), "waypoints:./points.csv", *files, "--link", "memory", "--duration", "1")
    Path("points.csv").unlink()
    Path("my-flight.toml").write_text("", encoding="utf-8")
    Path("my-hummingbird.toml").unlink()
    identical = "250 commands up to t = 0.996 s, all identical\n"
    flight = tmp_path / "out" / "flight.ulg"
    monkeypatch.chdir("/")
    assert ran("replay", flight).out == identical
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "autopilot/profiles/se3.toml", "my-flight.toml")
    assert ran("replay", flight).out == f"{identical}profile my-flight.toml is another by now: replayed as it flew\n"


def test_a_log_that_was_cut_short_is_not_the_flight(copy: Path, ran: Ran) -> None:
    log = copy / "flight.ulg"
    log.write_bytes(log.read_bytes()[:80_000])
    said = ran("replay", log, code=1)
    assert said.out.endswith(" s, all identical\n")
    assert said.err.endswith(" s, and the flight went on to t = 2.000 s: it was cut off\n")


def test_a_flight_of_six_rotors_is_recorded_and_replayed(tmp_path: Path) -> None:
    fly(
        tmp_path, "line", "--vehicle", "firefly", "--controller", "geometric-se3", "--link", "memory", "--duration", "1"
    )
    assert replay_flight(tmp_path) == (250, 996_000, None)
    samples = read_recording(tmp_path)
    assert samples["omega6"].min() > 83.8
    assert samples["U1"].mean() == pytest.approx(1.53 * 9.81, rel=0.2)
    motors = ULog(str(tmp_path / "flight.ulg")).get_dataset("actuator_motors").data
    assert motors["control[5]"][-1] > 0.1
    assert np.isnan(motors["control[6]"]).all()


def test_a_flight_on_sensors_is_replayed(tmp_path: Path) -> None:
    fly(tmp_path, "line", "--feedback", "sensors", "--seed", "2", "--link", "memory", "--duration", "4")
    assert replay_flight(tmp_path) == (1000, 3_996_000, None)


def change(log: Path, time_us: int, more: float) -> None:
    content = bytearray(log.read_bytes())
    rows = np.concatenate(list(FlightFile(log).blocks(COMMAND)))
    (row,) = rows[np.rint(1e6 * rows[:, 0]) == time_us]
    row[0] = time_us
    recorded = COMMAND.encode(row[None])
    row[1] += more
    at = content.index(recorded)
    content[at : at + len(recorded)] = COMMAND.encode(row[None])
    log.write_bytes(content)


def test_the_first_command_that_differs_is_named(copy: Path, ran: Ran) -> None:
    """By the least that the wire can carry."""
    change(copy / "flight.ulg", CHANGED_US, 2e-7)
    said = ran("replay", copy, code=1)
    assert said.out.startswith("first difference at t = 1.000 s, in mode track\n")
    assert "m/s, roll" in said.out
    assert said.err.endswith("flight.ulg: the autopilot does not answer as it did, after 250 commands\n")


def test_another_autopilot_is_found_out(copy: Path) -> None:
    log = FlightFile(copy / "flight.ulg")
    (setup,) = read_inputs(log.inputs()).setups.values()
    other = msgspec.structs.replace(setup, controller="geometric-se3", profile_tables=load_profile("se3"))
    began_again = encode_input(0, RecordKind.SETUP, msgspec.json.encode(other))  # the last one holds
    (copy / "flight.ulg").write_bytes(b"".join(log.encoded()) + began_again)
    difference = replay_flight(copy).difference
    assert difference is not None
    assert difference.recorded.time_us == 0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "flight.ulg: No such file"),
        (BEGINNING, "flight.ulg: no autopilot has begun in it"),
        (BEGINNING + encode_input(0, RecordKind.SETUP, b'{"what": "began"}'), "flight.ulg: input at t = 0.000 s: "),
        (b"x" * 100, "flight.ulg: not a ULog"),
    ],
)
def test_what_cannot_be_replayed_is_one_line(content: bytes | None, said: str, copy: Path, refused: Refused) -> None:
    (copy / "flight.ulg").unlink()
    if content is not None:
        (copy / "flight.ulg").write_bytes(content)
    assert said in refused("replay", copy)


def test_a_log_without_frames_is_not_replayed(copy: Path, refused: Refused) -> None:
    log = FlightFile(copy / "flight.ulg")
    (setup,) = read_inputs(log.inputs()).setups.values()
    rows = np.concatenate(list(log.blocks(COMMAND)))
    commands = COMMAND.encode(np.hstack([np.rint(1e6 * rows[:, :1]), rows[:, 1:]]))
    began = encode_input(0, RecordKind.SETUP, msgspec.json.encode(setup))
    (copy / "flight.ulg").write_bytes(BEGINNING + began + commands)
    assert "flight.ulg: no frame of state feedback was answered" in refused("replay", copy)


def test_what_ground_stations_ordered_is_replayed(tmp_path: Path) -> None:
    """Over UDP, in the air: the autopilot is killed and started again; then the vehicle lands. Its logs are dated."""
    dated = f"--boot-unix-us={BOOT_UNIX_US}"
    out, logs = tmp_path / "out", tmp_path / "logs"
    logs.mkdir()
    start = (dated, "--vehicle", "hummingbird", "--start", "z=3,psi=90,rotors=4740", "--speed", "4")
    plant = Process(logs, "plant", "--link", "udpin:127.0.0.1:0", *start, "--tlog", "--out", str(out))
    with Observer() as seen, running(plant):
        url = plant.wait_for("listening")["url"].replace("udpin", "udpout")
        options = (dated, "--plant", url, f"--gcs={seen.url}", "--out", str(out), "--state", str(tmp_path / "state"))
        first = Process(logs, "autopilot", *options)
        with running(first):
            seen.wait(lambda sight: sight.time_s > 1.0, "the vehicle")
            first.process.send_signal(signal.SIGKILL)
            first.wait()
        killed_s = seen.now.time_s
        second = Process(logs, "autopilot", *options)
        with running(second):
            again_s = seen.wait(lambda sight: sight.time_s > killed_s + 0.5, "the vehicle again").time_s
            assert seen.command(mav.MAV_CMD_NAV_LAND) == mav.MAV_RESULT_ACCEPTED
            seen.wait(lambda sight: not sight.armed, "the landing")
            date = seen.request("SYSTEM_TIME", "COMMAND_LONG", mav.MAV_CMD_REQUEST_MESSAGE, 0, 2, *[0.0] * 6)
            plant.process.send_signal(signal.SIGINT)
            plant.wait()
    setups = list(read_inputs(FlightFile(out / "flight.ulg").inputs()).setups.values())
    assert [bool(setup.history) for setup in setups] == [False, True]
    commands, last_us, difference = replay_flight(out)
    assert difference is None
    assert commands > 500
    assert last_us > setups[1].first_us + 2_000_000
    assert next(decode((out / "flight.tlog").read_bytes())).time_us == BOOT_UNIX_US
    log = ULog(str(max((tmp_path / "state").rglob("*.ulg"))))
    assert log.get_dataset("vehicle_status").data["timestamp"][0] > again_s * 1e6 - 1e6
    assert date.time_unix_usec == BOOT_UNIX_US + date.time_boot_ms * 1000
