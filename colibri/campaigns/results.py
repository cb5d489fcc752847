"""The results of a campaign."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from colibri.analysis.tables import comma_separated
from colibri.campaigns.factors import CampaignError
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.journal import keep_files
from colibri.experiments.flight import figure_html, table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def parquet_writer() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow.parquet import write_table
    except ImportError as error:
        raise CampaignError("Parquet needs pyarrow: pip install colibri-sitl[parquet]") from error
    return pyarrow, write_table


class CampaignResults(FlightTable):
    """The results of a campaign."""

    def plot(self, metric: str | None = None) -> "Figure":
        """Return a figure that suits the factors: distribution, line, or heat map."""
        from colibri.campaigns.figure import draw

        return draw(self, metric)

    def save(self, folder: str | Path, *, parquet: bool = False) -> Path:
        """Write `flights.csv`, `summary.csv`, `campaign.png` and optionally `flights.parquet`; return the folder."""
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
        headings, rows = self.summary()
        return table_html(self.campaign.name, (headings, *rows)) + figure_html(self.plot())
