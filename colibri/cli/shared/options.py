"""Options that several subcommands share."""

from collections.abc import Callable
from pathlib import Path


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


def add_out(add: Callable[..., object], folder: str, what: str) -> None:
    add("--out", type=Path, default=Path(folder), metavar="DIR", help=f"folder for {what} (default %(default)s)")
    add("--quiet", action="store_true", help="print errors only")
