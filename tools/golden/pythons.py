"""Other Python versions on this computer, each in an environment from the lock."""

import shutil
import subprocess
import sys
from pathlib import Path

MIN_MINOR, MAX_MINOR = 11, 19
"""Minor versions of Python 3 to look for."""
_MADE_FROM = ("requirements.lock", "pyproject.toml")
"""Sources of an environment: if it is older, it is stale."""
_SAYS_VERSION = "import sys; print('%d.%d' % sys.version_info[:2])"


def environments(root: Path) -> dict[str, Path]:
    found = {}
    for minor in range(MIN_MINOR, MAX_MINOR + 1):
        folder = root / f".venv-3.{minor}"
        if (folder / ".ready").exists():
            found[f"3.{minor}"] = folder / "bin" / "python"
    return found


def other_pythons() -> dict[str, Path]:
    found = {}
    for minor in range(MIN_MINOR, MAX_MINOR + 1):
        for python in _candidates(minor):
            if minor != sys.version_info.minor and _version(python) == f"3.{minor}":
                found[f"3.{minor}"] = python
                break
    return found


def is_stale(root: Path, version: str) -> bool:
    ready = root / f".venv-{version}" / ".ready"
    return not ready.exists() or ready.stat().st_mtime <= max((root / name).stat().st_mtime for name in _MADE_FROM)


def set_up(root: Path, version: str, python: Path) -> None:
    if not is_stale(root, version):
        return
    folder = root / f".venv-{version}"
    pip = (str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    for command in (
        (str(python), "-m", "venv", "--clear", str(folder)),
        (*pip, "--require-hashes", "-r", str(root / "requirements.lock")),
        (*pip, "--no-deps", "--no-build-isolation", "--editable", str(root)),
    ):
        subprocess.run(command, check=True, capture_output=True, text=True, cwd=root)
    (folder / ".ready").touch()


def _candidates(minor: int) -> list[Path]:
    kept = Path.home() / ".pyenv" / "versions"
    pyenv = sorted(kept.glob(f"3.{minor}.*"), key=lambda folder: [_number(part) for part in folder.name.split(".")])
    on_path = shutil.which(f"python3.{minor}")
    return [*(folder / "bin" / "python" for folder in reversed(pyenv)), *([Path(on_path)] if on_path else [])]


def _number(part: str) -> int:
    return int(part) if part.isdigit() else -1


def _version(python: Path) -> str:
    try:
        said = subprocess.run([str(python), "-c", _SAYS_VERSION], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return said.stdout.strip()
