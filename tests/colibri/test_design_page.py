"""The page of the design: every file that it names is there, every room is named, in the words of the room itself."""

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
PACKAGES = ("common", "mavlink", "plant", "autopilot", "colibri", "tools")
PATHS = ("a frame", "a COMMAND_LONG", "a parameter", "a QP")


def rooms() -> dict[str, str]:
    """Return what each room says of itself, by its folder."""
    found = {}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("__init__.py"):
            text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
            found[f"{path.parent.relative_to(ROOT)}/"] = " ".join(text.split())
    return found


def test_every_file_that_is_named_is_there() -> None:
    named = re.findall(r"`([\w/]+\.(?:py|toml))`", PAGE)
    assert len(named) > 60
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_every_room_is_there_in_its_own_words() -> None:
    assert dict(re.findall(r"^\| `([\w/]+/)` \| (.*) \|$", PAGE, re.MULTILINE)) == rooms()


def test_the_path_of_each_thing_names_its_files_in_every_step() -> None:
    for thing in PATHS:
        (section,) = re.findall(rf"^## The path of {thing}$(.*?)^## ", PAGE, re.DOTALL | re.MULTILINE)
        steps = re.split(r"^\d\. ", section, flags=re.MULTILINE)[1:]
        assert len(steps) >= 5
        assert sum(".py`" in step for step in steps) >= len(steps) - 1, thing


def test_the_house_is_drawn_with_the_rooms_that_the_contracts_know() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    drawings = "\n".join(re.findall(r"^```$(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE))
    for contract in project["tool"]["importlinter"]["contracts"]:
        for container in contract.get("containers", ()):
            if container in ("colibri", "colibri.autopilot", "colibri.plant"):
                names = {name for layer in contract["layers"] for name in re.split(r" [|:] ", layer)}
                for name in names - {"__main__", "pytest_plugin", "errors"}:
                    assert re.search(rf"\b{name}\b", drawings), f"{container}.{name}"


def test_links_lead_somewhere() -> None:
    for link in re.findall(r"\]\(([\w.-]+\.md)\)", PAGE):
        assert (ROOT / "docs" / link).is_file(), link
    assert "(docs/design.md)" in (ROOT / "README.md").read_text(encoding="utf-8")
