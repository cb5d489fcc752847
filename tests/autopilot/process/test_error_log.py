from pathlib import Path

import msgspec
import pytest

from colibri.autopilot.__main__ import command_line
from colibri.autopilot.core.defence.errors import ErrorRecord
from colibri.autopilot.core.defence.table import LAW
from colibri.autopilot.process.client import PlantClient
from colibri.autopilot.process.error_log import FILE, ErrorLog
from colibri.autopilot.process.ground import GroundService
from colibri.autopilot.process.run import run
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.lifecycle import EXIT_FAILED, Stop
from colibri.common.process.status import Status
from colibri.common.spec import from_namespace
from colibri.mavlink.links.open import open_link


def record(part: str = LAW) -> ErrorRecord:
    return ErrorRecord(
        time_us=8000,
        part=part,
        instead="plain law flies",
        error="ValueError: no",
        traceback="Traceback\n  File\nValueError: no\n",
        mode="hold",
        armed=True,
        frame=b"\x01\x02",
        checkpoint=b"",
    )


def test_each_is_a_line_and_each_part_is_said_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = ErrorLog(tmp_path, Status("autopilot", as_json=False))
    log.write([])
    assert not log.failed
    log.write([record(), record()])
    lines = (tmp_path / FILE).read_bytes().splitlines()
    assert [msgspec.json.decode(line, type=ErrorRecord) for line in lines] == [record(), record()]
    assert capsys.readouterr().err == (
        f"autopilot: control law failed (ValueError: no): plain law flies; traceback in {tmp_path / FILE}\n"
    )
    assert log.failed


@pytest.mark.parametrize("folder", [None, Path("/nowhere/at/all")])
def test_what_cannot_be_kept_is_on_standard_error(folder: Path | None, capsys: pytest.CaptureFixture[str]) -> None:
    ErrorLog(folder, Status("autopilot", as_json=False)).write([record()])
    said = capsys.readouterr().err
    assert said.startswith("Traceback\n")
    assert said.endswith("autopilot: control law failed (ValueError: no): plain law flies\n")


def test_the_process_ends_with_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fly(client: PlantClient, autopilot: object) -> None:
        del autopilot
        ground = client._ground  # noqa: SLF001
        assert isinstance(ground, GroundService)
        ground.copter.defence.caught(LAW, ValueError("no"))
        ground.serve(0.0)

    monkeypatch.setattr(PlantClient, "fly", fly)
    spec = from_namespace(
        AutopilotSpec, command_line().parse_args(["--gcs", "udpin:127.0.0.1:0", "--state", str(tmp_path)])
    )
    link = open_link("udpout:127.0.0.1:9")
    assert run(spec, link, Status("autopilot", as_json=False), Stop()) == EXIT_FAILED
    assert b"ValueError: no" in (tmp_path / FILE).read_bytes()
