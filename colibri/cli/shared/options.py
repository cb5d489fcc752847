"""Options that several subcommands share."""

from pathlib import Path

from colibri.analysis.limits import LossLimit, limit, loss_limit
from colibri.common.process.arguments import ArgumentParser


def add_engine(parser: ArgumentParser) -> None:
    parser.value("--workers", "N", "processes (default: one a core)", type=int)
    parser.value("--dask", "ADDRESS", "fly on a cluster: address of its Dask scheduler, for example tcp://HOST:8786")


def add_gate(parser: ArgumentParser, lost: LossLimit | None) -> None:
    """Add what continuous integration needs; `lost` is the default of `--fail-lost`."""
    parser.several(
        "--fail-above",
        "[KEY=]VALUE",
        "exit with 1 if a number of report.json is larger: rmse_after_20s_m (m), or another by its KEY, for "
        "example ground_contact_s=0",
        type=limit,
    )
    parser.value(
        "--fail-lost",
        "N|P%",
        "exit with 1 if more flights are lost or refused, a number or a share of all "
        f"(default: {'if all are' if lost is None else '0'})".replace("%", "%%"),
        type=loss_limit,
        default=lost,
    )
    parser.flag("--json", "print the result as JSON, and nothing else, on standard output")


def add_junit(parser: ArgumentParser) -> None:
    parser.value("--junit", "FILE", "write JUnit XML, one test case a flight", type=Path)


def add_out(parser: ArgumentParser, folder: str, what: str) -> None:
    parser.value("--out", "DIR", f"folder for {what}", type=Path, default=Path(folder))
    parser.flag("--quiet", "print errors only")
