"""The table of exit codes in docs/cli.md, over real processes."""

import fcntl
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from time import monotonic

import psutil
import pytest

from tests.colibri.cli.test_processes import flying
from tests.support.commands import exit_code
from tools.harness.ports import bound_socket
from tools.harness.processes import THESIS_PLANT, wait_for

COLIBRI = (sys.executable, "-m", "colibri")
KEPT = "; logs are in {}"


@pytest.mark.parametrize(
    ("whom", "number", "code", "line"),
    [
        pytest.param("colibri", signal.SIGINT, 130, "interrupted", marks=pytest.mark.long),
        ("colibri", signal.SIGTERM, 143, "ended by SIGTERM"),
        pytest.param("colibri", signal.SIGHUP, 129, "ended by SIGHUP", marks=pytest.mark.long),
        pytest.param("plant", signal.SIGTERM, 1, "the plant was ended by SIGTERM", marks=pytest.mark.long),
        ("autopilot", signal.SIGKILL, 1, "the autopilot was killed by SIGKILL"),
        pytest.param("plant", signal.SIGKILL, 1, "the plant was killed by SIGKILL", marks=pytest.mark.long),
        pytest.param("autopilot", signal.SIGHUP, 1, "the autopilot was ended by SIGHUP", marks=pytest.mark.long),
    ],
)
def test_a_signal_ends_the_flight_with_a_line(
    tmp_path: Path, whom: str, number: signal.Signals, code: int, line: str
) -> None:
    flight, children = flying(tmp_path)
    processes = {each.name(): each for each in children}
    processes.get(whom, flight).send_signal(number)
    _, said = flight.communicate(timeout=60.0)
    assert (flight.returncode, said) == (code, f"colibri: error: {line}{KEPT.format(tmp_path)}\n")
    assert (tmp_path / "flight.csv").exists()
    assert not any(each.is_running() for each in children)


@pytest.mark.parametrize("name", [pytest.param("plant", marks=pytest.mark.long), "autopilot"])
def test_a_stopped_process_holds_up_neither_signal_nor_end(tmp_path: Path, name: str) -> None:
    flight, children = flying(tmp_path)
    (held,) = (each for each in children if each.name() == name)
    held.suspend()
    wait_for(lambda: held.status() == psutil.STATUS_STOPPED, "the process to stop")
    flight.kill() if name == "plant" else flight.terminate()
    began_s = monotonic()
    for each in children:
        wait_for(partial(_has_ended, each), f"{each} to end")
    assert monotonic() < began_s + 4.0
    assert (flight.wait(), flight.communicate()[1].count("\n")) == ((-9, 0) if name == "plant" else (143, 1))


def _has_ended(process: psutil.Process) -> bool:
    return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE


def full_pipe() -> tuple[int, int]:
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    os.write(write, bytes(4096))
    return read, write


@pytest.mark.long
def test_an_unread_pipe_does_not_hold_up_a_flight(tmp_path: Path) -> None:
    free, called = bound_socket()
    free.close()
    read, write = full_pipe()
    link, out = called.replace("udpout", "udpin"), ("--json", "--out", str(tmp_path))
    command = [*COLIBRI, "plant", "--link", link, "--duration", "2", *out, *THESIS_PLANT]
    plant = subprocess.Popen(command, stdout=write, stderr=write)
    autopilot = subprocess.Popen([*COLIBRI, "autopilot", "--plant", called, "--profile", "thesis"], stderr=write)
    assert plant.wait(60.0) == 0
    autopilot.terminate()
    assert autopilot.wait(10.0) == 143
    os.close(read)
    os.close(write)


@pytest.mark.long
def test_a_fifo_in_a_files_place_is_bad_input(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    fifo, profile = tmp_path / "fifo", tmp_path / "fifo.toml"
    os.mkfifo(fifo)
    os.mkfifo(profile)
    calls = ("--gcs", "udpout:127.0.0.1:9")
    reason = "is a FIFO, device or socket: a regular file is required\n"
    out = ("--quiet", "--out", str(tmp_path / "out"))
    for options in (
        ("fly", "hover", *calls, "--signing-key", str(fifo), *out),
        ("fly", "hover", "--profile", str(profile), *out),
        ("fly", f"waypoints:{fifo}", *out),
        ("vehicle", "hummingbird", "--for", "px4", "--out", str(fifo)),
    ):
        assert exit_code([*options]) == 2, options
        assert capfd.readouterr().err.endswith(reason), options
    autopilot = [*COLIBRI, "autopilot", *calls, "--signing-key", str(fifo)]
    done = subprocess.run(autopilot, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr.endswith(reason)) == (2, True)
