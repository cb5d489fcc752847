"""`colibri.fly`: one flight from Python, and what came of it as an object."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from shutil import copytree, rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any
from weakref import finalize

from colibri.analysis.outcome import keep_flight
from colibri.analysis.recording import FlightReader
from colibri.analysis.report import Report, report_rows
from colibri.analysis.series.figure_series import FigureSeries
from colibri.common.errors import unknown
from colibri.common.spec import from_values, keywords_of
from colibri.experiments.notebook import figure_html, table_html
from colibri.experiments.table import Table, read_table
from colibri.flights.fly import fly_plan
from colibri.flights.folder import prepare
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec, OptionError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Flight:
    """What came of a flight. Its logs lie in a temporary folder, which goes with it; `save` keeps them.

    Attributes:
        plan: What was flown.
        report: The numbers of `report.json`.
    """

    def __init__(self, plan: FlightPlan, report: Report) -> None:
        """Be the flight of `plan`, whose folder goes with this."""
        self.plan = plan
        self.report = report
        finalize(self, rmtree, plan.out, ignore_errors=True)

    @property
    def sha256(self) -> str:
        """Of the plant's states at every frame: the same for the same flight, on every computer."""
        return str(self.report["trajectory_sha256"])

    @property
    def lost(self) -> str | None:
        """Why the vehicle was lost; None if it was not."""
        lost: str | None = self.report["lost"]
        return lost

    @cached_property
    def samples(self) -> Table:
        """`flight.csv`, a row a control sample: state, inputs, references; m, s, rad, N."""
        return read_table(self.plan.out / "flight.csv")

    @cached_property
    def frames(self) -> Table:
        """`plant.csv`, a row a frame: the true state, rotors, battery and wind."""
        return read_table(self.plan.out / "plant.csv")

    @cached_property
    def estimate(self) -> Table | None:
        """`estimate.csv`, a row a control sample: what the autopilot made of its sensors; None without them."""
        path = self.plan.out / "estimate.csv"
        return read_table(path) if path.exists() else None

    def plot(self, what: str = "error") -> "Figure":
        """Return a figure of the flight: `error`, `position`, `attitude`, `inputs`, `rotors` or `trajectory`.

        Raises:
            OptionError: There is no such figure.
        """
        from colibri.analysis.figures import figures_of

        series = FigureSeries(self.plan)
        for part in FlightReader(self.plan):
            series.add(part)
        known = []
        for name, figure in figures_of(series, self.plan):
            if name == what:
                return figure
            known.append(name)
        raise OptionError(unknown("figure", what, known))

    def save(self, folder: str | Path) -> Path:
        """Write logs, tables, report and figures of the flight into a folder that is new or empty; return it.

        Raises:
            OptionError: It holds something, or cannot be written.
        """
        path = Path(folder)
        try:
            if path.exists() and any(path.iterdir()):
                raise OptionError(f"save: {path} is not empty: choose another folder")
            copytree(self.plan.out, path, dirs_exist_ok=True)
        except OSError as error:
            raise OptionError(f"save: cannot write to {path}: {error.strerror}") from error
        return path

    def _repr_html_(self) -> str:
        """Return the report as a table, and the error over time, as a notebook shows them."""
        title = f"{self.plan.spec.track}, {self.plan.flown_by}"
        return table_html(title, report_rows(self.report).items()) + figure_html(self.plot())


def fly(track: str, **options: Any) -> Flight:
    """Fly a track, in this process and writing nothing that stays; return what came of it.

    Args:
        track: As `colibri fly` has it, with its options: `lemniscate:lap=5`.
        options: Those of `colibri fly`, by their names with underscores and as Python's values or as its texts:
            `seed=3, wind="5@270", start={"x": 1.0}, link="udp"`. In place of a name, `profile` takes a `Profile`,
            `vehicle` and `plant_vehicle` take a `Vehicle`, and `controller` a class, or what else makes a control law
            of the profile's table, the vehicle and a clock; its table is `controllers.NAME`, NAME being the class's.

    Raises:
        Error: What the command line would say in one line.
    """
    folder = Path(mkdtemp(prefix="colibri-"))
    try:
        given = {"track": track, **options}
        spec = from_values(FlightSpec, given, OptionError, keywords_of(FlightSpec))
        plan = FlightPlan.of(replace(spec, out=folder))
        prepare(folder)
        return Flight(plan, keep_flight(plan, fly_plan(plan)))
    except BaseException:
        rmtree(folder, ignore_errors=True)
        raise
