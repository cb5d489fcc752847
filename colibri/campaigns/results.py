"""What came of a campaign: its tables, their figure, and the folder that has them."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from colibri.analysis.tables import comma_separated
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.journal import keep_files
from colibri.campaigns.values import CampaignError
from colibri.experiments.notebook import figure_html, table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def parquet_writer() -> tuple[Any, Any]:
    """Return pyarrow, and its function that writes Parquet.

    Raises:
        CampaignError: It is not installed.
    """
    try:
        import pyarrow
        from pyarrow.parquet import write_table
    except ImportError as error:
        raise CampaignError("Parquet needs pyarrow: pip install colibri-sitl[parquet]") from error
    return pyarrow, write_table


class CampaignResults(FlightTable):
    """What came of a campaign, as `colibri.campaign` returns it."""

    def plot(self, metric: str | None = None) -> "Figure":
        """Return a figure that suits the factors: distribution, line over a factor, or heat map over two.

        Raises:
            CampaignError: The campaign has kept no such metric.
        """
        from colibri.campaigns.figure import draw

        return draw(self, metric)

    def save(self, folder: str | Path, *, parquet: bool = False) -> Path:
        """Write `flights.csv`, `summary.csv` and `campaign.png` into a folder, and return it; `parquet`: that, too.

        Raises:
            CampaignError: There is nothing installed that writes Parquet.
        """
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        if parquet:
            arrow, write_parquet = parquet_writer()
            columns = {name: self.flights[name] for name in self.headings}
            write_parquet(arrow.table(columns), path / "flights.parquet")
        (path / "flights.csv").write_text(comma_separated(self.headings, self.rows()), encoding="utf-8")
        (path / "summary.csv").write_text(comma_separated(*self.summary()), encoding="utf-8")
        for each in self.flown:
            keep_files(path, each)
        if self.flown:
            self.plot().savefig(path / "campaign.png", dpi=150)
        return path

    def _repr_html_(self) -> str:
        """Return the summary and the figure, as a notebook shows them."""
        headings, rows = self.summary()
        return table_html(self.campaign.name, (headings, *rows)) + figure_html(self.plot())
