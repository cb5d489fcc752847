"""The notebook of docs/ runs, and shows what it promises."""

import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import qpsolvers

import colibri

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOK = DOCS / "notebooks" / "first-flight.ipynb"


def shown(notebook: Any) -> list[list[str]]:
    """Return for each cell of code in which forms its result was shown."""
    outputs = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
    return [[form for output in cell for form in sorted(output.get("data", {}))] for cell in outputs]


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # of Jupyter's own threads and sockets
def test_the_notebook_runs(tmp_path: Path) -> None:
    from nbclient import NotebookClient

    notebook = import_module("nbformat").read(NOTEBOOK, as_version=4)
    kept = shown(notebook)
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    assert shown(notebook) == kept
    assert sum("image/png" in forms for forms in kept) == 2
    assert sum("text/html" in forms for forms in kept) == 2


@pytest.mark.parametrize(("name", "asserts"), [("lpv-model", 6), pytest.param("gym", 4, marks=pytest.mark.long)])
def test_what_a_notebook_asserts_holds(name: str, asserts: int) -> None:
    cells = json.loads((DOCS / "notebooks" / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    codes = [cell for cell in cells if cell["cell_type"] == "code"]
    exec("\n".join("".join(cell["source"]) for cell in codes), {})
    assert sum("assert" in line for cell in codes for line in cell["source"]) == asserts


def test_the_solver_of_the_page_flies(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (DOCS / "qp-solvers.md").read_text(encoding="utf-8")
    code, *_ = [block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "def solve" in block]
    monkeypatch.setattr(qpsolvers, "available_solvers", [*qpsolvers.available_solvers])
    monkeypatch.setattr(qpsolvers.solvers, "dense_solvers", [*qpsolvers.solvers.dense_solvers])
    exec(code, {})
    for profile in ("thesis", "flight"):
        theirs, ours = (
            colibri.fly("spiral", profile=profile, duration=2.0, **it) for it in ({"solver": "hildreth"}, {})
        )
        assert theirs.report["solver"] == "hildreth"
        assert theirs.report["qp_failures"] == 0
        assert np.abs(theirs.samples["z"] - ours.samples["z"]).max() < 1e-5
    del qpsolvers.solvers.solve_function["hildreth"]
