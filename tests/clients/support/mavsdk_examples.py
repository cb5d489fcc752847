"""Runs MAVSDK-Python's own examples, unmodified, each against a fresh `colibri sitl`; judges what the vehicle did.

    python -m tests.clients.support.mavsdk_examples FOLDER --python .venv-clients/bin/python

FOLDER is a checkout of https://github.com/mavlink/MAVSDK-Python, or its folder `examples`; `mavsdk` below version 4 is
in the environment of `--python`. Ports 14540 and 50051 must be free: the examples have no others.
"""

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from traceback import extract_tb
from typing import NamedTuple

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail
from tests.clients.support.client import Client
from tests.clients.support.example_flights import Evidence
from tests.clients.support.example_table import EXAMPLES, Example
from tools.harness.processes import SitlProcess, vehicle

SDK_LINK = "udpout:127.0.0.1:14540"


class Result(NamedTuple):
    example: Example
    failure: str
    seconds: float

    @property
    def verdict(self) -> str:
        return "failed" if self.failure else "passed, ended by the runner" if self.example.endless else "passed, exit 0"


def main(argv: list[str] | None = None) -> int:
    args = _parser().parse_args(argv)
    folder = args.folder / "examples" if (args.folder / "examples").is_dir() else args.folder
    chosen = [example for example in EXAMPLES if not args.only or example.name in args.only]
    missing = [example.name for example in chosen if not _script(folder, example.name).is_file()]
    if missing or not chosen:
        fail(f"no {missing[0]}.py in {folder}" if missing else f"--only: no example is called {args.only[0]}")
    results = []
    for example in chosen:
        result = _run(example, folder, args.python)
        results.append(result)
        sys.stdout.write(f"{example.name:32s} {result.verdict:28s} {result.seconds:6.1f} s\n")
        if result.failure:
            sys.stdout.write("    " + result.failure.replace("\n", "\n    ") + "\n")
        sys.stdout.flush()
    if args.table:
        args.table.write_text(table(results), encoding="utf-8")
    failed = sum(bool(result.failure) for result in results)
    sys.stdout.write(f"{len(results) - failed} of {len(results)} passed\n")
    return 1 if failed else 0


def table(results: Sequence[Result]) -> str:
    rows = [
        f"| {result.example.name} | {result.verdict} | {result.seconds:.1f} | {_shows(result.example)} |"
        for result in results
    ]
    return "\n".join(
        ["| Script | Result | Seconds | What the vehicle was seen to do |", "|---|---|---:|---|", *rows, ""]
    )


def _shows(example: Example) -> str:
    return (example.judge.__doc__ or "").partition("\n")[0].strip().rstrip(".")


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="mavsdk_examples", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a checkout of MAVSDK-Python")
    parser.add_argument("--python", type=Path, default=Path(sys.executable), help="that has mavsdk below version 4")
    parser.add_argument("--only", action="append", metavar="NAME", help="only this example; may be repeated")
    parser.add_argument("--table", type=Path, metavar="FILE", help="write the results there, as Markdown")
    return parser


def _script(folder: Path, name: str) -> Path:
    return folder.absolute() / f"{name}.py"


def _run(example: Example, folder: Path, python: Path) -> Result:
    began_s = monotonic()
    with TemporaryDirectory() as temporary:
        room = Path(temporary)
        try:
            with vehicle(room, *example.options, links=(SDK_LINK,)) as flown:
                if example.after:
                    before = next(other for other in EXAMPLES if other.name == example.after)
                    _judge(before, folder, python, room / "before", flown)
                _judge(example, folder, python, room / "client", flown)
        except (AssertionError, ArithmeticError, LookupError, OSError, ValueError) as failure:
            where = extract_tb(failure.__traceback__)[-1]
            return Result(example, f"{where.name}: {where.line}\n{failure}", monotonic() - began_s)
    return Result(example, "", monotonic() - began_s)


def _judge(example: Example, folder: Path, python: Path, room: Path, flown: SitlProcess) -> None:
    """Run an example in `room`, and demand that it and the vehicle do what they should.

    Raises:
        AssertionError: They do not.
    """
    room.mkdir()
    for name in example.files:
        shutil.copy(folder / name, room)
    for name, text in example.written.items():
        (room / name).write_text(text, encoding="utf-8")
    command = [str(python.absolute()), str(_script(folder, example.name)), *example.arguments]
    with Client(command, room) as client:
        evidence = Evidence(flown.seen, client, flown.state)
        if not example.endless:
            client.wait(example.within_s)
        example.judge(evidence)
        assert not example.endless or client.process.poll() is None, f"it ended by itself:\n{client.printed[-2000:]}"


if __name__ == "__main__":
    sys.exit(main())
