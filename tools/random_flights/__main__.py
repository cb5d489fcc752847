"""`python -m tools.random_flights`: flights by seeds, each with failures, parameters, modes and wind.

Each must raise nothing, report an impact, keep its fence as far as it can brake, be disarmed at its end, and take at
most 20 ms a frame. With at most one failed sensor it must not fall, hit the ground or overturn.
"""

import argparse
import sys
from time import perf_counter

from colibri.common.process.lifecycle import use_one_thread
from tools.harness.frame_times import gc_off
from tools.random_flights.flights import RandomFlight, RandomFlightOutcome, case_of, fly

MAX_FRAME_MS = 20.0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.random_flights", description=__doc__)
    parser.add_argument("--seeds", type=_seeds, default=range(1, 501), metavar="A[-B]", help="default 1-500")
    parser.add_argument("--verbose", action="store_true", help="print what happens in each flight")
    args = parser.parse_args()
    use_one_thread()
    began_s, flown_s, worst_ms, failed = perf_counter(), 0.0, 0.0, 0
    for seed in args.seeds:
        case = case_of(seed)
        verdict, frame_ms = _flown(case)
        flown_s, worst_ms = flown_s + verdict.flown_s, max(worst_ms, frame_ms)
        violated = verdict.violated or (f"a frame of {frame_ms:.1f} ms" if frame_ms > MAX_FRAME_MS else "")
        if args.verbose:
            print(f"seed {seed}: {case}", *verdict.texts, sep="\n", flush=True)
        if violated:
            failed += 1
            print(f"FAILED: {violated}; repeat: python -m tools.random_flights --verbose --seeds {seed}", flush=True)
    flights = f"{len(args.seeds)} flights, {failed} failed; {flown_s:.0f} s flown in {perf_counter() - began_s:.0f} s"
    print(f"{flights}; longest frame {worst_ms:.1f} ms of work")
    return 1 if failed else 0


def _flown(case: RandomFlight) -> tuple[RandomFlightOutcome, float]:
    """Return a flight and its longest frame, ms, of two flights if it seems too long."""
    with gc_off():
        verdict = fly(case)
        frames_s = verdict.frames_s
        if max(frames_s, default=0.0) * 1e3 > MAX_FRAME_MS:
            frames_s = list(map(min, frames_s, fly(case).frames_s))
    return verdict, max(frames_s, default=0.0) * 1e3


def _seeds(text: str) -> range:
    first, dash, last = text.partition("-")
    if not first.isdigit() or not (last.isdigit() if dash else not last) or int(last or first) < int(first):
        raise argparse.ArgumentTypeError(f'seeds "{text}" are invalid: A, or A-B with A up to B')
    return range(int(first), int(last or first) + 1)


if __name__ == "__main__":
    sys.exit(main())
