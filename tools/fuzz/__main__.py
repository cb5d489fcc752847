"""`python -m tools.fuzz`: the long campaign."""

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from colibri.autopilot.commander.rules.modes import Mode, State
from colibri.mavlink.files.folder import Folder
from tools.fuzz.campaign import Outcome, campaign
from tools.fuzz.ground import GroundOutcome, ground_campaign

BURST = 60
_SAY_EVERY_S = 10.0


def main() -> int:
    """Run the campaign and print what it came to; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.fuzz", description=__doc__)
    parser.add_argument("--datagrams", type=int, default=1_000_000, help="of each kind, to each process")
    parser.add_argument("--messages", type=int, default=1_000_000, help="to the ground-station side, in all modes")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    failures = _lockstep(args.datagrams, args.seed) + _ground(args.messages, args.seed)
    lines = [f"FAILED: {failure}" for failure in failures] or [
        "nothing raised, nothing turned, the flight is unchanged"
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    return 1 if failures else 0


def _lockstep(datagrams: int, seed: int) -> list[str]:
    """Fire between plant and autopilot."""
    started_s = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        outcome = campaign(Path(folder), datagrams, burst=BURST, seed=seed, progress=_Progress("flight"))
    _say(_table(outcome), started_s, seed)
    return outcome.failures + [f"{outcome.lost} datagrams never arrived"] * (outcome.lost > 0)


def _ground(messages: int, seed: int) -> list[str]:
    """Fire from ground stations."""
    started_s = perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Folder(Path(name))
        outcome = ground_campaign(messages, seed=seed, files=folder, progress=_Progress("messages"))
        folder.close()
    _say(_modes(outcome), started_s, seed)
    return outcome.failures


def _say(lines: list[str], started_s: float, seed: int) -> None:
    sys.stdout.write("\n".join([*lines, f"{perf_counter() - started_s:.0f} s, seed {seed}"]) + "\n\n")
    sys.stdout.flush()


class _Progress:
    def __init__(self, what: str) -> None:
        self._what = what
        self._due_s = perf_counter() + _SAY_EVERY_S

    def __call__(self, part: float) -> None:
        if perf_counter() > self._due_s:
            self._due_s = perf_counter() + _SAY_EVERY_S
            sys.stdout.write(f"{part:4.0%} of the {self._what}\n")
            sys.stdout.flush()


def _table(outcome: Outcome) -> list[str]:
    lines = [f"{'to':<10}{'random':>10}{'hostile':>10}{'MiB before':>12}{'after':>8}"]
    for name, (before, after) in outcome.memory_mib.items():
        counts = "".join(f"{outcome.sent[name, kind]:>10}" for kind in ("random", "hostile"))
        lines.append(f"{name:<10}{counts}{before:>12.2f}{after:>8.2f}")
    return [*lines, f"{outcome.lost} datagrams lost in the kernel"]


def _modes(outcome: GroundOutcome) -> list[str]:
    before, after = outcome.memory_mib
    lines = [f"{'ground stations to':<20}{'armed':>10}{'disarmed':>10}"]
    for mode in Mode:
        armed, disarmed = (outcome.sent.get(State(mode, armed=armed), 0) for armed in (True, False))
        lines.append(f"{mode:<20}{armed:>10}{disarmed:>10}")
    lines.append(f"{outcome.accepted} commands of {outcome.kinds} kinds accepted, {outcome.flown_s:.0f} s flown")
    return [*lines, f"{before:.2f} MiB before, {after:.2f} after"]


if __name__ == "__main__":
    sys.exit(main())
