"""`make soak`: the whole suite again and again; no verdict and no hash may differ."""

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

LINKS = ("memory", "udp")
WORKERS = 2
_BUSY = "while True: sum(range(10_000))"


def main(argv: Sequence[str] | None = None) -> int:
    args = _arguments(argv)
    links = LINKS if args.link == "both" else (args.link,)
    first: dict[str, str] = {}
    with TemporaryDirectory() as own, busy(os.cpu_count() or 1 if args.load else 0):
        folder = args.keep or Path(own)
        folder.mkdir(parents=True, exist_ok=True)
        for number, link in zip(range(1, args.runs + 1), cycle(links), strict=False):
            kept = folder / f"{number:04}-{link}"
            if not kept.exists():
                began_s = perf_counter()
                summary = _run(link, kept, args.only)
                took_s = perf_counter() - began_s
                print(f"{number} of {args.runs}, {link}, {took_s:.0f} s: {summary}", flush=True)
            lines = dict(line.split(" ", 1) for line in kept.read_text(encoding="utf-8").splitlines())
            first = first or lines
            for test in sorted(first.keys() | lines.keys()):
                then, now = (outcomes.get(test, "not run") for outcomes in (first, lines))
                if then != now:
                    print(f"run {number}, over {link}: {test}: {then} at first, {now} now")
                    return 1
    failed = sorted(test for test, outcome in first.items() if not outcome.startswith("passed"))
    print(f"{args.runs} runs of {len(first)} tests: no verdict and no hash differs, {len(failed)} failed")
    return 1 if failed else 0


def _run(link: str, kept: Path, only: str) -> str:
    hashes = kept.with_suffix(".part")
    command = [sys.executable, "-m", "pytest", "-q", "-m", "scenarios", "tests/scenarios/", "-n", str(WORKERS)]
    command += ["--dist", "worksteal", "--sitl-link", link, "--sitl-hashes", str(hashes)]
    command += ["-k", only] if only else []
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not hashes.exists():
        raise SystemExit(f"the suite did not run:\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    hashes.rename(kept)
    summary = [line for line in done.stdout.splitlines() if line.startswith("sitl: ")]
    return summary[-1] if summary else "nothing flown"


@contextmanager
def busy(processes: int) -> Iterator[None]:
    load = [subprocess.Popen([sys.executable, "-c", _BUSY]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in load:
            process.kill()
            process.wait()


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.soak.scenarios", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, choices=range(1, 10_001), metavar="N")
    parser.add_argument("--link", default="both", choices=("both", *LINKS), help="both: in turn (default)")
    parser.add_argument("--load", action="store_true", help="keep every core busy with something else meanwhile")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="what comes of each run; those that it has already are not run again"
    )
    parser.add_argument("--only", default="", metavar="EXPRESSION", help="as pytest's -k")
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
