"""Every command of README and docs/ is one that there is: read by the real parsers, looked up in the Makefile."""

import re
import shlex
from argparse import ArgumentParser
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.pages import PAGES, ROOT, blocks, prose
from tools.pages.reference.command_line import arguments_of, parsers

FOREIGN = {
    *("dask", "git", "head", "java", "mavproxy.py", "sim_vehicle.py", "export", "umask"),
    *("long", "param"),  # at MAVProxy's prompt
}
"""What begins lines that are no commands of ours."""
FOREIGN_TARGETS = {"px4_sitl"}


def command_lines() -> list[tuple[str, list[str]]]:
    """Return the commands of all blocks for a shell, with their pages: words, without comment and redirection."""
    found = []
    for page, _, text in blocks("sh"):
        for line in text.replace("\\\n", " ").splitlines():
            if "$(" in line:
                found.append((page, [line.split()[0]]))
                continue
            words = shlex.split(line, comments=True)
            ends = [at for at, word in enumerate(words) if word in (">", "&", "|")]
            words = words[: ends[0]] if ends else words
            if words[:2] == ["taskset", "-c"]:
                words = words[3:]
            if words:
                found.append((page, [words[0].removeprefix(".venv/bin/"), *words[1:]]))
    return found


@cache
def known() -> dict[str, ArgumentParser]:
    return parsers()


def test_there_are_many() -> None:
    assert sum(words[0] == "colibri" for _, words in command_lines()) > 100


def test_every_command_is_ours_or_known_to_be_another_s() -> None:
    first = {words[0] for _, words in command_lines()}
    assert first - FOREIGN == {"colibri", "make", "pytest"}


def test_the_parsers_read_every_command_of_colibri(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wind.csv").write_text("t,east,north,up\n0,0,0,0\n", encoding="utf-8")
    (tmp_path / "events.toml").write_text("events = []\n", encoding="utf-8")
    for page, words in command_lines():
        if words[0] == "colibri":
            try:
                known()[words[1]].parse_args(words[2:])
            except SystemExit as ended:
                pytest.fail(f"{page}: {shlex.join(words)}: exit code {ended.code}")


def test_options_that_prose_names_are_there() -> None:
    named = 0
    for path in PAGES:
        for code in re.findall(r"`(colibri [a-z-]+ [^`]*)`", prose(path)):
            _, command, *words = re.split(r"[\s\[\]|]+", code)
            assert command in known(), f"{path.name}: {code}"
            options = {option for action in arguments_of(known()[command]) for option in action.option_strings}
            given = {word.partition("=")[0] for word in words if word.startswith("--")}
            assert given <= options, f"{path.name}: {code}"
            named += 1
    assert named > 15


def test_the_makefile_has_every_target() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    asked = {words[1] for _, words in command_lines() if words[0] == "make"}
    for path in PAGES:
        asked |= set(re.findall(r"`make ([\w-]+)[^`]*`", prose(path)))
    assert asked - targets == FOREIGN_TARGETS


def test_pytest_has_the_options_of_our_plugin() -> None:
    plugin = (ROOT / "colibri" / "pytest_plugin.py").read_text(encoding="utf-8")
    used = {word.partition("=")[0] for _, words in command_lines() if words[0] == "pytest" for word in words}
    ours = {word for word in used if word.startswith("--sitl-")}
    assert ours
    for option in ours:
        assert f'"{option}"' in plugin


def test_modules_that_are_run_are_there() -> None:
    named = {name for path in PAGES for name in re.findall(r"python -m ([\w.]+)", path.read_text(encoding="utf-8"))}
    assert "tools.pages" in named
    for name in named - {"http.server"}:
        assert find_spec(name) is not None, name
