import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from tools.harness.processes import wait_for

FORKING = """
import threading
from colibri.flights.launcher import Child, end_children, how_it_ended
from colibri.plant.spec import PlantSpec

def begun(link="udpin:127.0.0.1:0"):
    child = Child(PlantSpec(link=link), fork=True)
    print("forked" if child.forked else "anew", end=": ")
    return child

wrong = begun("nothing")
print(how_it_ended(wrong.wait()))
for end in (Child.kill, lambda child: end_children([child])):
    child = begun()
    print(child.read()[0]["event"], end=", ")
    end(child)
    print(how_it_ended(child.code()))
waiting = threading.Event()
other = threading.Thread(target=waiting.wait)
other.start()
print(begun("nothing").wait())
waiting.set()
"""


def flying(out: Path) -> tuple["subprocess.Popen[str]", list[psutil.Process]]:
    command = [sys.executable, "-m", "colibri", "fly", "spiral", "--speed", "10", "--no-figures", "--out", str(out)]
    pipe, log = subprocess.PIPE, out / "flight.ulg"
    flight = subprocess.Popen(command, stderr=pipe, stdout=pipe, text=True, start_new_session=True)
    wait_for(lambda: log.exists() and log.stat().st_size > 30_000, "the flight to begin")
    return flight, psutil.Process(flight.pid).children(recursive=True)


def test_ctrl_c_ends_all_and_keeps_what_was_logged(tmp_path: Path) -> None:
    """A terminal interrupts the whole group."""
    flight, children = flying(tmp_path)
    assert len(children) == 2
    os.killpg(flight.pid, signal.SIGINT)
    _, said = flight.communicate(timeout=60.0)
    assert flight.returncode == 130
    assert said.splitlines()[-1] == f"colibri: error: interrupted; logs are in {tmp_path}"
    assert "Traceback" not in said
    assert not any(child.is_running() for child in children)
    flown = (tmp_path / "flight.csv").read_text(encoding="utf-8").splitlines()
    assert len(flown) > 10
    assert flown[0].startswith("t,u,v,w,p,q,r,x,y,z,phi,theta,psi,U1")


def test_forked_processes_fly_the_same() -> None:
    command = [sys.executable, "-P", "-u", "-c", FORKING]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60.0)
    assert done.stdout.splitlines() == [
        "forked: ended with exit code 2",
        "forked: listening, was killed by SIGKILL",
        "forked: listening, was ended by SIGTERM",
        "anew: 2",
    ]
    error = "colibri: error: nothing: expected udpin:HOST:PORT or udpout:HOST:PORT"
    assert done.stderr.splitlines() == [error, error]


def test_a_flight_loads_no_compiler_solver_or_plotter(tmp_path: Path) -> None:
    words = ["fly", "hover", "--link", "memory", "--duration", "0.1", "--quiet", "--no-figures", "--out", str(tmp_path)]
    heavy = {"numba.np.arraymath", "scipy.linalg", "scipy.sparse", "qpsolvers", "matplotlib", "rich"}
    program = f"import sys\nfrom colibri.cli.main import main\nmain({words})\nprint({heavy} & set(sys.modules))"
    for _ in range(2):  # in the first it may have to be compiled
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        if done.stdout == "set()\n":
            break
    assert done.stdout == "set()\n"


@pytest.mark.parametrize("package", ["plant", "autopilot"])
def test_a_process_whose_parent_was_gone_before_it_began_ends(package: str) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    link = ("--link", "udpin:127.0.0.1:0") if package == "plant" else ("--plant", "udpout:127.0.0.1:9")
    command = [sys.executable, "-m", f"colibri.{package}", "--json", "--parent", str(gone.pid), *link]
    assert subprocess.run(command, capture_output=True, check=False, timeout=60.0).returncode == 129


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(("fly", "hover", "--link", "udp", "--no-figures"), id="fly"),
        pytest.param(("compare", "--track", "hover"), id="compare", marks=pytest.mark.long),
    ],
)
def test_files_of_the_working_directory_shadow_no_module(tmp_path: Path, options: tuple[str, ...]) -> None:
    for name in ("plant", "autopilot", "mavlink", "numpy", "signal", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('of the working directory')")
    colibri = str(Path(sys.executable).parent / "colibri")
    command = [colibri, *options, *["--profile", "flight", "--duration", "0.1", "--quiet", "--out", "out"]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "of the working directory" not in done.stdout + done.stderr
    assert (done.returncode, done.stderr) == (0, "")
