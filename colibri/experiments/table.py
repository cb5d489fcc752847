"""Tables of a flight as structured arrays, and HTML of tables and figures for notebooks."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from colibri.common.errors import Error
from colibri.common.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class PandasError(Error):
    """pandas is not installed."""


class SampleTable(np.ndarray[Any, np.dtype[np.void]]):
    """A structured array, (n,), of float64 by column name: `table["x"]`."""

    def __getitem__(self, key: Any) -> Any:
        found = super().__getitem__(key)
        return found.view(np.ndarray) if isinstance(found, SampleTable) and found.dtype.names is None else found

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame; PandasError if pandas is not installed."""
        try:
            from pandas import DataFrame
        except ImportError as error:
            raise PandasError("to_pandas() needs pandas: pip install pandas") from error
        return DataFrame({name: self[name] for name in self.dtype.names or ()})


def table_of(columns: Sequence[str], blocks: Iterable[Array]) -> SampleTable:
    rows = np.concatenate([np.empty((0, len(columns))), *blocks])
    return rows.view([(name, np.float64) for name in columns])[:, 0].view(SampleTable)


def table_html(title: str, rows: Iterable[Sequence[str]]) -> str:
    cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    return f"<b>{escape(title)}</b><table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def figure_html(figure: "Figure") -> str:
    png = BytesIO()
    figure.savefig(png, format="png", dpi=80)
    return f'<img src="data:image/png;base64,{b64encode(png.getvalue()).decode()}">'
