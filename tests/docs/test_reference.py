"""The pages of reference that the code writes are current, and know all that there is."""

import ast
import re
from collections.abc import Callable
from inspect import getsource

import pytest
from PIL import Image

from colibri.analysis.estimation import FIGURES
from colibri.analysis.recording import COLUMNS
from colibri.analysis.report import report
from colibri.autopilot.control.registry import controller_names
from colibri.cli.commands import COMMANDS
from tests.support.pages import DOCS
from tools.pages import parameters
from tools.pages.reference import command_line, files, keys, messages, python

GENERATED = command_line.PAGES | files.PAGES | keys.PAGES | messages.PAGES | parameters.PAGES | python.PAGES


@pytest.mark.parametrize(("name", "renewed"), GENERATED.items())
def test_a_page_that_is_generated_is_current(
    name: str, renewed: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")  # the page is no terminal
    page = (DOCS / name).read_text(encoding="utf-8")
    assert page == renewed(page)


def test_the_page_of_commands_has_every_command() -> None:
    page = (DOCS / "cli.md").read_text(encoding="utf-8")
    assert {*re.findall(r"^## colibri ([\w-]+)$", page, re.MULTILINE)} == {*COMMANDS, "plant", "autopilot"}


def test_the_page_of_keys_has_every_control_law_that_comes_along() -> None:
    assert {*keys.LAWS} == {*controller_names()}


def test_the_page_of_files_has_every_column_and_every_key() -> None:
    (returned,) = (node for node in ast.walk(ast.parse(getsource(report))) if isinstance(node, ast.Return))
    assert isinstance(returned.value, ast.Dict)
    keys_of_report = [
        name for key in returned.value.keys for name in (FIGURES if key is None else [ast.literal_eval(key)])
    ]
    for name, wanted in (("flight.csv", [*COLUMNS]), ("report.json", keys_of_report)):
        page = (DOCS / "files.md").read_text(encoding="utf-8")
        _, _, *rows = page.partition(f"| of `{name}` |")[2].partition("\n\n")[0].splitlines()
        assert [column for row in rows for column in re.findall(r"`(\w+)`", row.split("|")[1])] == wanted


def test_the_flight_moves() -> None:
    with Image.open(DOCS / "lemniscate.gif") as moving:
        assert getattr(moving, "n_frames", 1) > 30
