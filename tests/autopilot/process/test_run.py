"""The autopilot's process with ground stations: what it refuses to start with, and how it says so."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, SOCK_STREAM, socket

import pytest

from colibri.autopilot.__main__ import command_line
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.process.run import run
from colibri.autopilot.process.state_folder import StateFolder
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.lifecycle import Stop
from colibri.common.process.status import Status
from colibri.common.spec import from_namespace
from colibri.mavlink.links.open import open_link
from colibri.plant.vehicle.description import load_vehicle

PARAMETERS = "lpv-mpc-asctec-hummingbird.params"


class AtOnce(Stop):
    def __init__(self) -> None:
        self.code = 130

    def __bool__(self) -> bool:
        return True


@pytest.fixture
def taken() -> Iterator[str]:
    with socket(AF_INET, SOCK_STREAM) as stream, socket(AF_INET, SOCK_DGRAM) as datagrams:
        stream.bind(("127.0.0.1", 0))
        datagrams.bind(stream.getsockname())
        stream.listen()
        yield f"127.0.0.1:{stream.getsockname()[1]}"


def start(*options: str) -> int:
    """Start the process as the command line says, and end it before its first frame; return the exit code."""
    plant = "udpout:127.0.0.1:9"
    spec = from_namespace(AutopilotSpec, command_line().parse_args(["--plant", plant, *options]))
    link = open_link(plant)
    try:
        return run(spec, link, Status("autopilot", as_json=False), AtOnce())
    finally:
        link.close()


def refused(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    with pytest.raises(SystemExit) as ended:
        start(*options)
    assert ended.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("colibri: error: ")
    assert said.err.count("\n") == 1
    return said.err.removeprefix("colibri: error: ")[:-1]


@pytest.mark.parametrize("scheme", ["udpin", "tcpin"])
def test_a_port_that_is_taken(capsys: pytest.CaptureFixture[str], taken: str, scheme: str) -> None:
    url = f"{scheme}:{taken}"
    assert refused(capsys, "--gcs", url) == (
        f"{url}: Address already in use; end the program that has this port, or name another"
    )


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (bytes(range(31)), "expected 32 bytes or 64 hexadecimal digits, found 31 bytes"),
        (bytes(32), "the key is all zeros"),
    ],
    ids=["short", "zeros"],
)
@pytest.mark.parametrize("kept", [False, True], ids=["given", "kept"])
def test_a_key_that_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, line: str, kept: bool
) -> None:
    path = tmp_path / "signing.key"
    path.write_bytes(content)
    given = ("--state", str(tmp_path)) if kept else ("--signing-key", str(path))
    assert refused(capsys, "--gcs", "udpin:127.0.0.1:0", *given) == f"signing key {path}: {line}"


def test_a_key_file_that_cannot_be_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "--gcs", "udpin:127.0.0.1:0", "--signing-key", str(tmp_path / "key"))
    assert said == f"cannot read signing key {tmp_path / 'key'}: No such file or directory"
    said = refused(capsys, "--gcs", "udpin:127.0.0.1:0", "--signing-key", str(tmp_path))
    assert said == f"cannot read signing key {tmp_path}: Is a directory"


def test_a_kept_timestamp_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "signing.timestamp").write_text("yesterday")
    said = refused(capsys, "--gcs", "udpin:127.0.0.1:0", "--state", str(tmp_path))
    assert said == f"{tmp_path / 'signing.timestamp'}: not a whole number; remove it once the clock is right"


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"MPC_XY_VEL_MAX = 3\n", "line 1: expected 5 columns between tabs, not 1; correct or remove it"),
        (b"1\t1\tMIS_TAKEOFF_ALT\thigh\t9\n", "line 1: "),
        (b"\xff\xfe\n", "'utf-8' codec can't decode byte 0xff in position 0: invalid start byte"),
    ],
    ids=["columns", "value", "bytes"],
)
def test_a_parameter_file_that_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, line: str
) -> None:
    path = tmp_path / PARAMETERS
    path.write_bytes(content)
    said = refused(capsys, "--gcs", "udpin:127.0.0.1:0", "--state", str(tmp_path))
    assert str(path) in said
    assert line in said


def test_the_parameters_that_the_former_name_kept(tmp_path: Path) -> None:
    former = tmp_path / f"whole-{PARAMETERS}"
    former.write_text("1\t1\tWHL_POLE1\t-6\t9\n", encoding="utf-8")
    profile, vehicle = load_profile("flight"), load_vehicle("hummingbird")
    with closing(StateFolder(AutopilotSpec(state=tmp_path), profile, vehicle, lambda: 0)) as folder:
        assert folder.parameters() == {"LPV_POLE1": -6.0}


def test_a_state_folder_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.touch()
    said = refused(capsys, "--gcs", "udpin:127.0.0.1:0", "--state", str(file / "state"))
    assert said == f"cannot write to --state {file / 'state'}: Not a directory"


@pytest.mark.parametrize("url", ["udpin:0.0.0.0:0", "udpout:192.0.2.1:14550", "tcpin:0.0.0.0:0", "tcp:192.0.2.1:5760"])
def test_a_link_beyond_this_computer_without_a_key(capsys: pytest.CaptureFixture[str], url: str) -> None:
    assert refused(capsys, "--gcs", url) == (
        f"{url} reaches beyond this computer: give --signing-key FILE, or --insecure to accept commands from anyone"
    )


@pytest.mark.parametrize("allows", ["--insecure", "--signing-key"])
def test_a_remote_link_needs_a_key_or_an_explicit_option(tmp_path: Path, allows: str) -> None:
    (tmp_path / "key").write_text("0f" * 32)
    value = (str(tmp_path / "key"),) if allows == "--signing-key" else ()
    assert start("--gcs", "udpin:0.0.0.0:0", allows, *value) == 130


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--gcs", "14550"), "14550: expected udpin:HOST:PORT or udpout:HOST:PORT or tcpin:HOST:PORT or tcp:HOST:PORT"),
        (("--home", "47,8"), "argument --home: expected LAT,LON,ALT,YAW in degrees and metres, not 47,8"),
        (("--identity", "betaflight"), 'argument --identity: unknown value "betaflight" (choose '),
        (("--system-id", "0"), "argument --system-id: must be a whole number from 1 to 255, not 0"),
        (("--controller", "pid"), 'unknown controller "pid" (choose '),
        (("--track", "loop"), 'unknown track "loop" (choose spiral'),
    ],
)
def test_a_command_line_that_is_none(capsys: pytest.CaptureFixture[str], options: tuple[str, ...], line: str) -> None:
    assert refused(capsys, "--gcs", "udpin:127.0.0.1:0", *options).startswith(line)
