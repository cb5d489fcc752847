"""`colibri.fly`: fly from Python."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from io import BytesIO
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any
from warnings import warn

import msgspec
import numpy as np

from colibri.analysis.figure_series import FigureSeries
from colibri.analysis.logs import log_of
from colibri.analysis.outcome import REPORT, files_of, fly_to_its_end, report_of
from colibri.analysis.recording import FlightReader, columns_of
from colibri.analysis.report import Report, report_rows
from colibri.common.config import UNREADABLE
from colibri.common.errors import Error, checked, unknown
from colibri.common.files import read_bytes
from colibri.common.spec import from_values, keywords_of
from colibri.common.types import Array
from colibri.flights.effects import NoEffectWarning, in_words
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import plan_of
from colibri.flights.spec import FlightSpec, OptionError
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.ulog.flight_topics import ESTIMATE, TRUTH
from colibri.mavlink.ulog.log import TopicReader

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


@dataclass(eq=False)
class Flight:
    """A finished flight in memory.

    Attributes:
        report: The numbers of `report.json`.
        log: The topics of its log.
    """

    plan: FlightPlan
    report: Report
    log: TopicReader

    @property
    def sha256(self) -> str:
        """Hash of the plant's states at all frames, the same on every computer."""
        return str(self.report["trajectory_sha256"])

    @property
    def lost(self) -> str | None:
        """Why the vehicle was lost, or `None`."""
        lost: str | None = self.report["lost"]
        return lost

    @property
    def impact(self) -> str | None:
        """Hardest ground contact beyond 3 m/s or 60°, or `None`."""
        impact: str | None = self.report["impact"]
        return impact

    @cached_property
    def samples(self) -> SampleTable:
        """`flight.csv`, one row per control sample: state, inputs, references; m, s, rad, N."""
        return table_of(columns_of(self.plan), (part.table for part in FlightReader(self.plan, self.log)))

    @cached_property
    def frames(self) -> SampleTable:
        """One row per frame: true state, rotors, battery and wind."""
        return table_of(TRUTH.names, self.log.blocks(TRUTH))

    @cached_property
    def estimate(self) -> SampleTable | None:
        """On sensors the state estimate, one row per control sample; else `None`."""
        table = table_of(ESTIMATE.names, self.log.blocks(ESTIMATE))
        return table if self.plan.spec.feedback is Feedback.SENSORS else None

    def plot(self, what: str = "error") -> "Figure":
        """Return a figure: `error`, `position`, `attitude`, `inputs`, `rotors` or `trajectory`.

        Raises:
            OptionError: The name is unknown.
        """
        from colibri.analysis.figures import figures_of

        reader = FlightReader(self.plan, self.log)
        figures = figures_of(FigureSeries(self.plan, reader.samples, reader), self.plan)
        if what not in figures:
            raise OptionError(unknown("figure", what, figures))
        return figures[what]()

    def save(self, folder: str | Path) -> Path:
        """Write log, table, report and provenance to a new or empty folder.

        Raises:
            OptionError: The folder is not empty, or cannot be written.
        """
        checked("folder", folder, (str, PurePath), "a name", OptionError)
        path = Path(folder)
        try:
            if path.exists() and any(path.iterdir()):
                raise OptionError(f"save: {path} is not empty: choose another folder")
            path.mkdir(parents=True, exist_ok=True)
            for name, content in files_of(self.plan, self.report, self.log):
                (path / name).write_bytes(content)
        except OSError as error:
            raise OptionError(f"save: cannot write to {path}: {error.strerror}") from error
        return path

    def _repr_html_(self) -> str:
        title = f"{self.plan.spec.track}, {self.plan.flown_by}"
        return table_html(title, report_rows(self.report).items()) + figure_html(self.plot())


def load_flight(folder: str | PurePath) -> Flight:
    """Read a flight from a folder of `colibri fly` or `save`.

    Its log is read on demand. After an early end, the report covers the flight until then.

    Raises:
        Error: The folder has no flight, or one of another version.
    """
    checked("folder", folder, (str, PurePath), "the folder of a flight", OptionError)
    path = Path(folder)
    plan, log = plan_of(path), log_of(path)
    try:
        report = msgspec.json.decode(read_bytes(path / REPORT), type=dict[str, Any])
    except FileNotFoundError:
        report = report_of(plan, log, None)
    except OSError as error:
        raise OptionError(f"cannot read {path / REPORT}: {error.strerror}") from error
    except UNREADABLE as error:
        raise OptionError(f"{path / REPORT}: {error}") from error
    return Flight(plan, report, log)


def fly(track: Any, **options: Any) -> Flight:
    """Fly a track in this process, without permanent files.

    Args:
        track: As in `colibri fly`, with its options: `lemniscate:lap=5`; or a function of time or an object, whose
            positions are sampled.
        options: As in `colibri fly`, with underscores, as Python values or texts: `seed=3, wind="5@270", start={"x":
            1.0}, link="udp"`. `profile` also takes a `Profile`, `vehicle` and `plant_vehicle` a `Vehicle`, and
            `controller` a class or another factory of (table of the profile, vehicle, clock); its table is
            `controllers.NAME`, with the name of the class.

    Raises:
        Error: An input is invalid, or the flight failed.
    """
    spec = from_values(FlightSpec, {"track": track, **options}, OptionError, keywords_of(FlightSpec))
    plan = FlightPlan.of(spec)
    if plan.without_effect:
        warn(in_words(plan.without_effect.items()), NoEffectWarning, stacklevel=2)
    outcome = fly_to_its_end(plan, for_viewers=True)
    if outcome.error is not None:
        raise outcome.error
    assert outcome.report is not None, "a flight that came to its end has a report"
    return Flight(plan, outcome.report, outcome.log)
