"""`colibri fly` with a law or a track of somebody else's, in this process and in whatever process it starts."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from colibri.autopilot.control.registry import registered, registered_origin
from tests.support.commands import exit_code
from tests.support.foreign import LAW, TRACK, Ended, FlyTheirs, Package


@pytest.fixture
def fly_theirs(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Iterator[FlyTheirs]:
    package: Package = TRACK if "trajectories" in request.path.parts else LAW

    def forget() -> None:
        sys.modules.pop(package.module, None)
        registered.cache_clear()
        registered_origin.cache_clear()

    def fly(source: str, *words: str) -> Ended:
        monkeypatch.setenv("PYTHONPATH", package.install(tmp_path, source))
        monkeypatch.syspath_prepend(tmp_path)
        forget()
        code = exit_code(["fly", *words, "--quiet", "--no-figures", "--out", str(tmp_path / "out")])
        return Ended(code, capfd.readouterr().err)

    yield fly
    forget()
