"""`python -m tests.fuzz`: the long campaign."""

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from tests.fuzz.campaign import Outcome, campaign

BURST = 60
_SAY_EVERY_S = 10.0


def main() -> int:
    """Run the campaign and print what it came to; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--datagrams", type=int, default=1_000_000, help="of each kind, to each process")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    started_s = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        outcome = campaign(Path(folder), args.datagrams, burst=BURST, seed=args.seed, progress=_Progress())
    failures = outcome.failures + [f"{outcome.lost} datagrams never arrived"] * (outcome.lost > 0)
    lines = [*_table(outcome), f"{perf_counter() - started_s:.0f} s, seed {args.seed}"]
    lines += [f"FAILED: {failure}" for failure in failures] or ["nothing raised, the flight is unchanged"]
    sys.stdout.write("\n".join(lines) + "\n")
    return 1 if failures else 0


class _Progress:
    def __init__(self) -> None:
        self._due_s = perf_counter() + _SAY_EVERY_S

    def __call__(self, part: float) -> None:
        if perf_counter() > self._due_s:
            self._due_s = perf_counter() + _SAY_EVERY_S
            sys.stdout.write(f"{part:4.0%} of the flight\n")
            sys.stdout.flush()


def _table(outcome: Outcome) -> list[str]:
    lines = [f"{'to':<10}{'random':>10}{'hostile':>10}{'MiB before':>12}{'after':>8}"]
    for name, (before, after) in outcome.memory_mib.items():
        counts = "".join(f"{outcome.sent[name, kind]:>10}" for kind in ("random", "hostile"))
        lines.append(f"{name:<10}{counts}{before:>12.2f}{after:>8.2f}")
    return [*lines, f"{outcome.lost} datagrams lost in the kernel"]


if __name__ == "__main__":
    sys.exit(main())
