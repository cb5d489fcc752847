"""The house: every room is small and says what it is for."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAX_FILES = 12
"""Files of a room, without `__init__.py`."""
ROOMS = sorted(
    {
        path.parent.relative_to(ROOT).as_posix()
        for folder in ("autopilot", "colibri", "common", "mavlink", "plant", "tools")
        for path in (ROOT / folder).rglob("*.py")
    }
)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_is_small_and_says_what_it_is_for(room: str) -> None:
    files = {path.name for path in (ROOT / room).glob("*.py")}
    assert "__init__.py" in files
    assert len(files) - 1 <= MAX_FILES
    assert ast.get_docstring(ast.parse((ROOT / room / "__init__.py").read_text(encoding="utf-8")))


@pytest.mark.parametrize("name", ["autopilot", "common", "mavlink", "plant"])
def test_a_package_is_linked_to_its_folder_by_a_relative_link(name: str) -> None:
    link = ROOT / "colibri" / name
    if link.is_symlink():  # in a source distribution it is the folder itself
        assert link.readlink() == Path("..", name)
    assert (link / "__init__.py").is_file()
