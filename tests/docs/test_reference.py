"""The pages of reference that the code writes are current, and know all that there is."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from colibri.autopilot.control.registry import controller_names
from colibri.cli.shared.commands import COMMANDS
from tests.support.pages import DOCS
from tools.pages import parameters
from tools.pages.__main__ import main
from tools.pages.pictures import house
from tools.pages.reference import command_line, files, keys, messages, python
from tools.pages.tables import with_tables


def test_the_page_of_commands_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")  # the page is no terminal
    page = command_line.page()
    assert (DOCS / "cli.md").read_text(encoding="utf-8") == page
    assert {*re.findall(r"^## colibri ([\w-]+)$", page, re.MULTILINE)} == {*COMMANDS, "plant", "autopilot"}


@pytest.mark.parametrize(
    ("name", "page"),
    [
        ("profile-keys.md", lambda: keys.pages()["profile-keys.md"]),
        ("vehicle-keys.md", lambda: keys.pages()["vehicle-keys.md"]),
        ("messages.md", messages.page),
        ("parameters.md", parameters.page),
        ("python-api.md", python.page),
    ],
)
def test_a_page_that_is_generated_is_current(name: str, page: Callable[[], str]) -> None:
    assert (DOCS / name).read_text(encoding="utf-8") == page()


def test_the_page_of_keys_has_every_control_law_that_comes_along() -> None:
    assert {*keys.LAWS} == {*controller_names()}


def test_the_columns_of_the_files_are_current() -> None:
    page = (DOCS / "files.md").read_text(encoding="utf-8")
    assert page == with_tables(page, files.tables())


def test_the_picture_of_the_house_is_current(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert house.layers().keys() == house.PACKAGES.keys()
    monkeypatch.setattr("sys.argv", ["pages", "pictures.house", str(tmp_path)])
    assert main() == 0
    for path in (tmp_path / "house.png", DOCS / "house.png"):
        with Image.open(path) as drawn:
            assert drawn.info["Description"] == house.description()


def test_the_flight_moves() -> None:
    with Image.open(DOCS / "lemniscate.gif") as moving:
        assert getattr(moving, "n_frames", 1) > 30
