"""A package of somebody else's: installed as pip would as far as Python looks, and flown with by `colibri fly`."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeAlias

DOCS = Path(__file__).parents[2] / "docs"


class Ended(NamedTuple):
    returncode: int | str | None
    stderr: str


FlyTheirs: TypeAlias = Callable[..., Ended]
"""(source of the module, words of `colibri fly`...) -> how it ended."""


class Package(NamedTuple):
    """A package of one module, and its entry points by group: `name = Class` each."""

    module: str
    group: str
    entry_points: tuple[str, ...]

    def install(self, folder: Path, source: str) -> str:
        (folder / f"{self.module}.py").write_text(source, encoding="utf-8")
        information = folder / f"{self.module}-1.0.dist-info"
        information.mkdir()
        name = self.module.replace("_", "-")
        (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
        lines = [entry.replace("= ", f"= {self.module}:") for entry in self.entry_points]
        text = "\n".join([f"[{self.group}]", *lines, ""])
        (information / "entry_points.txt").write_text(text, encoding="utf-8")
        return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])


LAW = Package("their_law", "colibri.controllers", ("their-name = TheirLaw", "broken = Nowhere"))
TRACK = Package("their_track", "colibri.tracks", ("helix = Helix",))


def example(page: str) -> str:
    code, *_ = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)
    return str(code)
