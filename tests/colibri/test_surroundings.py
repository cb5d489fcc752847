"""`colibri` where output is not read or cannot be written, and where the home cannot be."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from colibri.common.machine_code.on_disk import folders


@pytest.mark.parametrize("options", [("--version",), ("show", "profile", "flight")])
def test_output_that_takes_no_more_is_one_line(options: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "colibri", *options]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "colibri: error: cannot write to disk: No space left on device\n")


def test_output_that_nobody_reads_is_no_traceback() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "colibri", "show", "profile", "flight"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.long
def test_a_home_that_cannot_be_written_to_is_not_spoken_of(tmp_path: Path) -> None:
    """By matplotlib, which would; what it makes is kept for the next time."""
    home, temporary = tmp_path / "home", tmp_path / "temporary"
    home.touch()
    temporary.mkdir()
    unset = {name: value for name, value in os.environ.items() if name not in ("MPLCONFIGDIR", "XDG_CONFIG_HOME")}
    options = ("--link", "memory", "--duration", "0.5", "--out", str(tmp_path / "out"), "--quiet")
    command = [sys.executable, "-m", "colibri", "fly", "hover", *options]
    there = {"HOME": str(home), "TMPDIR": str(temporary), "NUMBA_CACHE_DIR": str(folders()[0])}
    done = subprocess.run(command, env={**unset, **there}, capture_output=True, text=True, check=True)
    assert str(home) not in done.stderr  # on a slow computer it says that it looks for fonts
    assert "temporary cache directory" not in done.stderr
    assert list((temporary / f"colibri-{os.getuid()}").glob("fontlist-*.json"))
