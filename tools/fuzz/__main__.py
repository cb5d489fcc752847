"""`python -m tools.fuzz`: long campaigns of many seeds, side by side."""

import argparse
import sys

from colibri.campaigns.engines import in_order
from colibri.common.process.arguments import seeds
from tools.fuzz.campaign import Job, fire


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.fuzz", description=__doc__)
    parser.add_argument("--datagrams", type=int, default=1_000_000, help="of each kind, to each process")
    parser.add_argument("--messages", type=int, default=1_000_000, help="to the ground-station side, in all modes")
    parser.add_argument("--seeds", type=seeds, default=seeds("1-20"), metavar="FIRST-LAST", help="default 1-20")
    parser.add_argument("--lockstep", type=int, default=5, help="how many seeds are for plant and autopilot, too")
    args = parser.parse_args()
    jobs = [Job(seed, args.datagrams, 0) for seed in args.seeds[: args.lockstep]]
    jobs += [Job(seed, 0, args.messages) for seed in args.seeds]
    results = in_order(fire, jobs, "fuzzing", quiet=False, keep=lambda each: print(each[0], flush=True))
    failures = [failure for _, found in results for failure in found]
    print(*[f"FAILED: {failure}" for failure in failures] or [f"{len(jobs)} campaigns, and nothing failed"], sep="\n")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
