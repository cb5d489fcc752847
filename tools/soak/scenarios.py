"""`make soak`: the whole suite again and again, in memory and over UDP in turn; no verdict and no hash may differ."""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory

LINKS = ("memory", "udp")


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.soak.scenarios", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, choices=range(1, 10_001), metavar="N")
    runs: int = parser.parse_args(argv).runs
    first: dict[str, str] = {}
    for number, link in zip(range(1, runs + 1), cycle(LINKS), strict=False):
        outcomes = _run(link)
        first = first or outcomes
        print(f"{number} of {runs}, {link}: {len(outcomes)} tests", flush=True)
        for test in sorted(first.keys() | outcomes.keys()):
            then, now = (of.get(test, "not run") for of in (first, outcomes))
            if then != now:
                print(f"run {number}, over {link}: {test}: {then} at first, {now} now")
                return 1
    failed = sorted(test for test, outcome in first.items() if not outcome.startswith("passed"))
    print(f"{runs} runs of {len(first)} tests: no verdict and no hash differs, {len(failed)} failed")
    return 1 if failed else 0


def _run(link: str) -> dict[str, str]:
    """Return each test's verdict and hash."""
    with TemporaryDirectory() as folder:
        hashes = Path(folder, "hashes")
        command = [sys.executable, "-m", "pytest", "-q", "-m", "scenarios", "tests/scenarios/", "-n", "2"]
        command += ["--dist", "worksteal", "--sitl-link", link, "--sitl-hashes", str(hashes)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not hashes.exists():
            raise SystemExit(f"the suite did not run:\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
        return dict(line.split(" ", 1) for line in hashes.read_text(encoding="utf-8").splitlines())


if __name__ == "__main__":
    sys.exit(main())
