"""The first flight of an installation compiles on all cores before it flies."""

from pathlib import Path

import pytest

from colibri.cli import compilation
from colibri.common.machine_code import on_disk


@pytest.mark.parametrize("place", ["home", "image"])
def test_only_the_first_flight_compiles_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    compiled: list[str] = []
    monkeypatch.setattr(on_disk, "folder_to_write", lambda: tmp_path / "home")
    monkeypatch.setattr(on_disk, "read_only_folders", lambda: [tmp_path / "image"])
    monkeypatch.setattr(compilation, "_compile", lambda names, **_: compiled.extend(names))
    compilation.compile_first("thesis", quiet=True)
    (tmp_path / place).mkdir()
    (tmp_path / place / "colibri.common.matrices.dot-1.nbc").touch()  # compiled at import
    compilation.compile_first("race", quiet=True)
    (tmp_path / place / "colibri.plant.physics.equations.hold-1.nbc").touch()
    compilation.compile_first("flight", quiet=True)
    assert compiled == ["thesis", "flight"]
