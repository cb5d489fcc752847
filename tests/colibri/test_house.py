"""Packages of the import name `colibri`."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["autopilot", "common", "mavlink", "plant"])
def test_a_package_is_linked_to_its_folder_by_a_relative_link(name: str) -> None:
    link = ROOT / "colibri" / name
    if link.is_symlink():  # in a source distribution it is the folder itself
        assert link.readlink() == Path("..", name)
    assert (link / "__init__.py").is_file()
