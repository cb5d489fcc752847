"""What is installed is `colibri` and nothing else, however it gets there."""

import subprocess
import sys
import tarfile
import tomllib
from functools import partial
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement

from tests.support.installs import ROOT, build, environment

PACKAGES = ("analysis", "autopilot", "bench", "cli", "common", "flights", "mavlink", "plant", "sitl", "studies")
EVERY_MODULE = """
import pkgutil, sys
from importlib import import_module
from os.path import realpath

import colibri

for entry in pkgutil.walk_packages(colibri.__path__, "colibri."):
    if not entry.name.endswith("__main__"):
        import_module(entry.name)
files = {}
for name, module in list(sys.modules.items()):
    path = getattr(module, "__file__", None)
    if path and realpath(path).startswith(sys.argv[1] + "/") and "site-packages" not in path:
        files.setdefault(realpath(path), []).append(name)
        assert name.split(".")[0] == "colibri", name
assert len(files) > 300, len(files)
print([names for names in files.values() if len(names) > 1])
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("sdist", tmp_path_factory.mktemp("sdist"))


def contents(wheel: Path) -> dict[str, bytes]:
    with ZipFile(wheel) as file:
        return {name: file.read(name) for name in file.namelist()}


def test_the_wheel_has_colibri_and_nothing_else(wheel: Path) -> None:
    names = {name for name in contents(wheel) if ".dist-info/" not in name}
    assert {name.split("/")[0] for name in names} == {"colibri"}
    assert {name.split("/")[1] for name in names} >= {*PACKAGES, "__init__.py", "py.typed", "pytest_plugin.py"}
    assert {"colibri/autopilot/profiles/flight.toml", "colibri/plant/vehicle/models/hummingbird.toml"} <= names


@pytest.mark.long
def test_a_wheel_of_the_source_distribution_is_the_same(wheel: Path, sdist: Path, tmp_path: Path) -> None:
    with tarfile.open(sdist) as file:
        file.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    assert {path.name for path in source.iterdir()} >= {"colibri", "docs", "tests", "tools", "README.md", "LICENSE"}
    assert contents(build("wheel", tmp_path / "dist", source)) == contents(wheel)


def test_what_flies_is_locked_as_for_development() -> None:
    flying, developing = (
        set((ROOT / name).read_text().splitlines()) for name in ("requirements-fly.lock", "requirements.lock")
    )
    assert flying <= developing
    more = (ROOT / "requirements-more.lock").read_text().splitlines()
    shared = {line.partition("==")[0] for line in developing} & {line.partition("==")[0] for line in more}
    assert {line for line in more if line.partition("==")[0] in shared} <= developing
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    assert {Requirement(one).name for one in needed} <= {line.partition("==")[0] for line in flying}


def test_a_checkout_without_links_is_not_built(tmp_path: Path) -> None:
    for name in ("pyproject.toml", "README.md", "LICENSE", "tools/whole_checkout.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    (tmp_path / "colibri").mkdir()
    (tmp_path / "colibri/autopilot").write_text("../autopilot")
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr.startswith("colibri: colibri/autopilot must be a link")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.long
def test_no_file_is_loaded_under_two_names() -> None:
    command = [sys.executable, "-c", EVERY_MODULE, str(ROOT)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


@pytest.mark.long
@pytest.mark.parametrize("kind", ["wheel", "sdist", "editable"])
def test_what_is_installed_flies(kind: str, wheel: Path, sdist: Path, tmp_path: Path) -> None:
    what = {"wheel": (str(wheel),), "sdist": (str(sdist),), "editable": ("--editable", str(ROOT))}[kind]
    commands = environment(tmp_path / "environment", *what)
    python = partial(subprocess.run, cwd=tmp_path, capture_output=True, text=True)
    told = python([commands / "python", "-c", "import colibri; print(colibri.__file__)"], check=True).stdout
    assert told.startswith(str(ROOT if kind == "editable" else tmp_path))
    for link in ("memory", "udp"):
        flight = ["fly", "spiral", "--link", link, "--duration", "1", "--quiet", "--no-figures", "--out", str(tmp_path)]
        subprocess.run([commands / "colibri", *flight], cwd=tmp_path, check=True)
    (tmp_path / "test_first.py").write_text("def test_flight(sitl):\n    sitl.arm()\n    sitl.takeoff(1.0)\n")
    done = python([commands / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider"], check=False)
    assert "1 passed" in done.stdout, done.stdout + done.stderr
