"""The notebook of docs/ runs, and shows what it promises."""

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebooks" / "first-flight.ipynb"


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
