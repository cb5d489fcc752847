"""HTML of tables and figures, for notebooks."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def table_html(title: str, rows: Iterable[Sequence[str]]) -> str:
    cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    return f"<b>{escape(title)}</b><table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def figure_html(figure: "Figure") -> str:
    png = BytesIO()
    figure.savefig(png, format="png", dpi=80)
    return f'<img src="data:image/png;base64,{b64encode(png.getvalue()).decode()}">'
