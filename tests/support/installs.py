"""What is built of this repository, and environments to install it in without a network."""

import subprocess
import sys
from pathlib import Path
from sysconfig import get_path

ROOT = Path(__file__).parents[2]


def build(kind: str, folder: Path, source: Path = ROOT) -> Path:
    """Return what hatchling builds of `source`: a `wheel` or an `sdist`."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (built,) = folder.glob({"wheel": "*.whl", "sdist": "*.tar.gz"}[kind])
    return built


def environment(folder: Path, *what: str) -> Path:
    """Return the `bin` of a new environment with `what` pip shall install, and whatever this one has besides."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    (site,) = folder.glob("lib/python3*/site-packages")
    (site / "others.pth").write_text(get_path("purelib") + "\n", encoding="utf-8")
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "install", "--quiet"]
    options = ("--disable-pip-version-check", "--no-deps", "--no-index", "--no-compile", "--no-build-isolation")
    subprocess.run([*pip, *options, "--ignore-installed", *what], check=True)
    return folder / "bin"
