"""Options that several subcommands share."""

from collections.abc import Callable
from pathlib import Path

from colibri.analysis.limits import LossLimit, limit, loss_limit


def add_signing(add: Callable[..., object]) -> None:
    add(
        "--signing-key",
        type=Path,
        metavar="FILE",
        help="sign messages, and refuse messages without a signature of this key",
    )
    add("--insecure", action="store_true", help="let links leave this computer without a key")


def add_engine(add: Callable[..., object]) -> None:
    add("--workers", type=int, metavar="N", help="processes (default: one a core)")
    add(
        "--dask",
        metavar="ADDRESS",
        help="fly on a cluster: address of its Dask scheduler, for example tcp://HOST:8786",
    )


def add_gate(add: Callable[..., object], lost: LossLimit | None) -> None:
    """Add what continuous integration needs; `lost` is the default of `--fail-lost`."""
    add(
        "--fail-above",
        type=limit,
        action="append",
        default=[],
        metavar="[KEY=]VALUE",
        help="exit with 1 if a number of report.json is larger: rmse_after_20s_m (m), or another by its "
        "KEY, for example ground_contact_s=0; may be repeated",
    )
    add(
        "--fail-lost",
        type=loss_limit,
        default=lost,
        metavar="N|P%",
        help="exit with 1 if more flights are lost or refused, a number or a share of all "
        f"(default: {'if all are' if lost is None else '0'})".replace("%", "%%"),
    )
    add("--json", action="store_true", help="print the result as JSON, and nothing else, on standard output")


def add_junit(add: Callable[..., object]) -> None:
    add("--junit", type=Path, metavar="FILE", help="write JUnit XML, one test case a flight")


def add_out(add: Callable[..., object], folder: str, what: str) -> None:
    add("--out", type=Path, default=Path(folder), metavar="DIR", help=f"folder for {what} (default %(default)s)")
    add("--quiet", action="store_true", help="print errors only")
