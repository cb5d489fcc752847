"""What each package names as public: is there, is what it says, and costs nothing before it is asked for."""

import ast
import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

FACES = (
    "colibri",
    *("colibri.analysis", "colibri.autopilot", "colibri.campaigns", "colibri.common", "colibri.companion"),
    "colibri.conformance",
    *("colibri.experiments", "colibri.flights", "colibri.mavlink"),
    *("colibri.plant", "colibri.sitl", "colibri.tuning", "colibri.view"),
)
PACKAGES = (
    *FACES,
    "colibri.arena",
    "colibri.bench",
    "colibri.certification",
    "colibri.cli",
    "colibri.gym",
    "colibri.lpv",
    "colibri.studies",
    "colibri.verification",
)
MAX_IMPORT_MS = 50.0
TRIES = 5
IMPORT = "import sys, time; t = time.process_time(); import colibri; print((time.process_time() - t) * 1e3)"


def told_to_mypy(package: ModuleType) -> dict[str, str]:
    """Return the module of each name that a package imports where types are checked."""
    assert package.__file__ is not None
    tree = ast.parse(Path(package.__file__).read_text(encoding="utf-8"))
    (branch,) = [node for node in tree.body if isinstance(node, ast.If)]
    assert ast.unparse(branch.test) == "TYPE_CHECKING"
    imports = [node for node in branch.body if isinstance(node, ast.ImportFrom)]
    assert len(imports) == len(branch.body)
    return {alias.name: str(node.module) for node in imports for alias in node.names}


@pytest.mark.parametrize("name", FACES)
def test_every_public_name_is_what_mypy_takes_it_for(name: str) -> None:
    package = import_module(name)
    told = told_to_mypy(package)
    assert sorted(told) == sorted(package.__all__)
    for public, place in told.items():
        assert getattr(package, public) is getattr(import_module(place), public)
    assert set(package.__all__) <= set(dir(package))


@pytest.mark.parametrize("name", FACES)
def test_no_public_name_hides_a_module(name: str) -> None:
    package = import_module(name)
    for folder in package.__path__:
        assert not {path.stem for path in Path(folder).iterdir()} & set(package.__all__)


@pytest.mark.parametrize("name", PACKAGES)
def test_what_is_not_there_is_an_attribute_error(name: str) -> None:
    package: Any = import_module(name)
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = package.nonsense
    with pytest.raises(ImportError, match="nonsense"):
        exec(f"from {name} import nonsense")


def test_each_package_says_what_is_public() -> None:
    root = Path(import_module("colibri").__path__[0])
    packages = {f"colibri.{path.parent.name}" for path in root.glob("*/__init__.py")}
    assert packages == {*PACKAGES} - {"colibri"}
    for name in PACKAGES:
        assert isinstance(import_module(name).__all__, list), name


def test_every_name_at_once() -> None:
    names: dict[str, object] = {}
    exec("from colibri import *", names)
    assert {"Controller", "Decision", "Preview", "Error"} <= names.keys()


def test_colibri_itself_is_imported_in_no_time() -> None:
    took_ms = [float(subprocess.check_output([sys.executable, "-c", IMPORT], text=True)) for _ in range(TRIES)]
    assert min(took_ms) < MAX_IMPORT_MS, took_ms


def test_colibri_itself_imports_nothing_that_is_large() -> None:
    said = subprocess.check_output([sys.executable, "-c", "import sys, colibri; print(*sys.modules)"], text=True)
    assert not {"numpy", "numba", "msgspec", "pymavlink", "scipy", "argparse", "asyncio"} & set(said.split())


def test_what_the_page_of_control_laws_imports_is_public() -> None:
    page = (Path(__file__).parents[2] / "docs" / "controllers.md").read_text(encoding="utf-8")
    (sentence,) = re.findall(r"^A law imports everything from `colibri`.*?\n\n", page, re.DOTALL | re.MULTILINE)
    named = set(re.findall(r"`(\w+)`", sentence)) - {"colibri"}
    assert len(named) > 10
    assert named <= set(import_module("colibri").__all__)


def test_the_version_is_that_of_the_package() -> None:
    assert import_module("colibri").__version__ == version("colibri-sitl")
