"""`python -m tests.fuzz`: the long campaign."""

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from tests.fuzz.campaign import campaign

BURST = 40
MOST_LOST = 0.01
"""Of the datagrams, in the kernel's buffers: what never arrived was no test."""


def main() -> int:
    """Run the campaign and print what it came to; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--datagrams", type=int, default=1_010_000, help="of each kind, to each process")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    started_s = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        outcome = campaign(Path(folder), args.datagrams, burst=BURST, seed=args.seed)
    failures = outcome.failures
    failures += ["too many never arrived"] * (outcome.lost > MOST_LOST * sum(outcome.sent.values()))
    lines = [f"{count} {kind} datagrams to the {to}" for (to, kind), count in outcome.sent.items()]
    lines += [f"the {name} grew by {mib:.2f} MiB" for name, mib in outcome.growth_mib.items()]
    lines += [f"{outcome.lost} datagrams lost in the kernel", f"{perf_counter() - started_s:.0f} s"]
    lines += [f"FAILED: {failure}" for failure in failures] or ["nothing raised, the flight is unchanged"]
    sys.stdout.write("\n".join(lines) + "\n")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
