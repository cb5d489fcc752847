"""`colibri.fly`: one flight from Python, and what came of it as an object."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from shutil import copytree, rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import finalize

from colibri.analysis.outcome import keep_flight
from colibri.analysis.recording import FlightReader
from colibri.analysis.report import Report, report_rows
from colibri.analysis.series.figure_series import FigureSeries
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.control.registry import Factory
from colibri.autopilot.process.options import delay_s
from colibri.experiments.notebook import figure_html, table_html
from colibri.experiments.options import OptionError, read_keywords
from colibri.experiments.table import Table, read_table
from colibri.flights.fly import fly_plan
from colibri.flights.folder import prepare
from colibri.flights.plan import FlightPlan
from colibri.plant.vehicle.description import Vehicle, load_vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BY_NAME = ("profile", "vehicle", "plant_vehicle", "controller", "wind")
"""Options whose value may be an object in place of the name that the command line has."""

T = TypeVar("T", Profile, Vehicle)


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
        raise OptionError(f"plot: unknown figure {what}: choose {', '.join(known)}")

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
        title = f"{self.plan.track_name}, {self.plan.flown_by}"
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
        plan = plan_of(track, options, folder)
        prepare(folder)
        return Flight(plan, keep_flight(plan, fly_plan(plan)))
    except BaseException:
        rmtree(folder, ignore_errors=True)
        raise


def plan_of(track: str, options: Mapping[str, Any], out: Path) -> FlightPlan:
    """Return the plan of a flight by keywords, see `fly`; its logs will be in `out`.

    Raises:
        Error: There is no such option, or what it names cannot be flown.
    """
    objects = {name: options[name] for name in BY_NAME if not isinstance(options.get(name), str | None)}
    args = read_keywords(track, {name: value for name, value in options.items() if name not in objects})
    if objects and args.link == "udp":
        raise OptionError(
            f"{next(iter(objects))}: over udp two processes fly, which know it by its name or file: fly link='memory'"
        )
    law: Factory | None = objects.get("controller")
    args.controller = law_name(law) if law else args.controller
    args.wind = objects.get("wind", args.wind)
    profile = _loaded(objects.get("profile"), args.profile, Profile, load_profile)
    profile = profile.with_choices(args.controller, args.solver, delay_s(args.delay))
    named = args.vehicle or profile.simulation.vehicle
    vehicle = _loaded(objects.get("vehicle"), named, Vehicle, load_vehicle)
    flown = objects.get("plant_vehicle") or (None if args.plant_vehicle else vehicle)
    plant_vehicle = _loaded(flown, args.plant_vehicle, Vehicle, load_vehicle).without(args.without)
    args.profile = profile.name if "profile" in objects else args.profile
    args.vehicle = vehicle.name if "vehicle" in objects else args.vehicle
    args.plant_vehicle = plant_vehicle.name if "plant_vehicle" in objects else args.plant_vehicle
    args.gcs, args.signing_key, args.insecure, args.out = (), None, False, out
    return FlightPlan.of_contents(args, track, profile, vehicle, plant_vehicle, law)


def law_name(law: Any) -> str:
    """Return by which name a control law goes that was handed over: the class's, or the function's."""
    return str(getattr(law, "__name__", type(law).__name__))


def _loaded(given: Any, name: str, kind: type[T], load: Any) -> T:
    if given is None:
        loaded: T = load(name)
        return loaded
    if not isinstance(given, kind):
        raise OptionError(f"expected a {kind.__name__} or its name, not {type(given).__name__}")
    return given
