import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from colibri.common.process.lifecycle import nudge_m
from tests.support.commands import FLIGHT, VEHICLE, edited, exit_code

DEEP = 50_000
CONTENTS = {
    "empty": b"",
    "zeros": b"\0" * 300,
    "binary": bytes(range(256)) * 20,
    "array": b"[" * DEEP + b"]" * DEEP,
    "object": b'{"a":' * DEEP + b"1" + b"}" * DEEP,
    "nested": b"a = " + b"[" * DEEP + b"]" * DEEP,
    "tables": b"a = " + b"{a=" * 5000 + b"1" + b"}" * 5000,
    "no-fields": b"{}",
    "text": b'"a"',
    "digits": b"1" * 5000,
    "escapes": b"t,x,y,z\n0,\x1b[31mred\x07,0,0\n",
    "escaped-key": b'"\\u001b[31mX" = 1\n',
    "long-cell": b"t,x,y,z\n0," + b"A" * 300_000 + b",0,0\n",
    "long-header": b"A" * 300_000 + b"\n1\n",
    "long-key": b'"' + b"k" * 300_000 + b'" = 1\n',
    "not-finite": b"t,x,y,z\n0,nan,inf,0\n1,0,0,0\n",
}
FLOWN = "--link memory --quiet --duration 0.1 --out {folder}/out"
COMPANION = "companion --vehicle udpin:127.0.0.1:0 --dry-run --wait 1"
COMMANDS = [
    f"fly waypoints:{{file}}.csv {FLOWN}",
    f"fly samples:{{file}}.csv {FLOWN}",
    f"fly hover --wind {{file}}.csv {FLOWN}",
    f"fly hover --vehicle {{file}}.toml {FLOWN}",
    f"fly hover --profile {{file}}.toml {FLOWN}",
    "campaign {file}.toml --quiet --out {folder}/out",
    "tune {file}.toml --quiet --out {folder}/out",
    "certify {file}.toml --out {folder}/out",
    "vehicle --for px4 {file}.toml",
    "export --csv {file}.ulg",
    "replay {file}.ulg",
    "plot {file}.ulg",
    "view --export {folder}/v.html {file}.ulg",
    f"{COMPANION} {{file}}.plan",
    f"{COMPANION} hover --response {{file}}.toml",
    f"{COMPANION} hover --signing-key {{file}}.key",
    "verify --golden {file}.json --only hover --out {folder}/out",
]


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert exit_code(words) in (1, 2), words
    line = capsys.readouterr().err
    assert line.startswith("colibri: error: "), words
    assert len(line) < 2100, words
    assert line.endswith("\n"), words
    assert line.count("\n") == 1, (words, line)
    assert line[:-1].isprintable(), (words, line)
    return line


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.split("{")[0].replace(" ", "-"))
def test_hostile_files_get_one_line(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    suffix = command.split("{file}")[1].split()[0]
    for name, content in CONTENTS.items():
        (tmp_path / f"{name}{suffix}").write_bytes(content)
    (tmp_path / f"folder{suffix}").mkdir()
    for name in (*CONTENTS, "folder", "missing", "\x1b[31m"):
        said([word.format(file=tmp_path / name, folder=tmp_path) for word in command.split(" ")], capsys)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flown")
    assert exit_code(f"fly hover --link memory --no-figures --quiet --duration 0.5 --out {folder}".split()) == 0
    return folder


def wrong_provenance(content: bytes) -> Iterator[bytes]:
    yield from CONTENTS.values()
    for key, value in (("spec", []), ("vehicle", {}), ("profile", "\x1b[31m"), ("plant_vehicle", None)):
        yield json.dumps(json.loads(content) | {key: value}).encode()


def test_hostile_provenance_gets_one_line(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = flown / "provenance.json"
    content = path.read_bytes()
    for wrong in wrong_provenance(content):
        path.write_bytes(wrong)
        said(["plot", str(flown)], capsys)
        said(["view", "--export", str(flown / "v.html"), str(flown)], capsys)
    path.write_bytes(content)


def test_damaged_logs_get_one_line(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = flown / "flight.ulg"
    content = path.read_bytes()
    for wrong in CONTENTS.values():
        path.write_bytes(wrong)
        for command in ("plot", "replay", "export --csv", f"view --export {flown / 'v.html'}"):
            said([*command.split(), str(flown)], capsys)
    path.write_bytes(content)


def test_a_log_that_ends_in_a_long_message_is_not_read_forever(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = flown / "long.ulg"
    path.write_bytes((flown / "flight.ulg").read_bytes()[:16] + b"\0" * 30_000 + b"\x64" + b"\0" * 7)
    assert "long.ulg is not a ULog" in said(["export", "--csv", str(path)], capsys)


@pytest.mark.parametrize(
    ("option", "source", "old", "new", "line"),
    [
        ("--vehicle", VEHICLE, "mass_kg = 0.698", "mass_kg = 1e308", "mass_kg: must be 0, or from 1e-12 to 1e+12"),
        ("--vehicle", VEHICLE, "mass_kg = 0.698", "mass_kg = inf", "mass_kg: must be finite"),
        ("--profile", FLIGHT, "control_interval_s = 0.008  #", "control_interval_s = -1e308  #", "control_interval_s"),
        ("--profile", FLIGHT, "max_tilt_deg = 70.0    #", "max_tilt_deg = []    #", "max_tilt_deg"),
    ],
)
def test_hostile_numbers(
    option: str, source: Path, old: str, new: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = edited(tmp_path, source, old, new)
    words = f"fly lemniscate {FLOWN} {option} {path}".format(folder=tmp_path).split()
    assert line in said(words, capsys)


@pytest.mark.parametrize("offset", ["nan", "inf", "-inf", "far", "", "1e9"])
def test_a_nudge_is_a_short_distance(
    offset: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLIBRI_NUDGE_M", offset)
    line = said(f"fly hover {FLOWN}".format(folder=tmp_path).split(), capsys)
    assert f'COLIBRI_NUDGE_M must be a number from -100 to 100, not "{offset}"' in line
    monkeypatch.setenv("COLIBRI_NUDGE_M", "1e-9")
    assert nudge_m() == 1e-9


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [("NUMBA_DISABLE_JIT", "1", "must be unset"), pytest.param("MPLBACKEND", "nonsense", "", marks=pytest.mark.long)],
)
def test_variables_of_other_packages(name: str, value: str, line: str, tmp_path: Path) -> None:
    words = f"fly hover {FLOWN}".format(folder=tmp_path).split()
    command = [sys.executable, "-m", "colibri", *words]
    done = subprocess.run(command, env=os.environ | {name: value}, capture_output=True, text=True, check=False)
    expected = (2, f"colibri: error: {name} {line}: kernels are compiled\n") if line else (0, "")
    assert (done.returncode, done.stderr) == expected


@pytest.mark.parametrize("columns", ["0", "1", "-1", "text"])
def test_help_is_readable_in_any_width(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    for words in (["--help"], ["fly", "--help"]):
        assert exit_code(words) == 0
    assert "plant" in capsys.readouterr().out
