"""The campaign against the ground-station side: messages fired at a vehicle in every mode it has."""

import gc
import random
from collections.abc import Sequence
from itertools import pairwise
from statistics import median
from traceback import format_exc
from typing import NamedTuple

import psutil

from colibri.autopilot.commander.rules.modes import State
from colibri.mavlink.files.tree import Files
from tools.fuzz.vehicle import SITUATIONS, BrokenError, Target

MAX_GROWTH_MIB = 4.0
FEWEST_FOR_MEMORY = 200_000
"""Messages: after fewer, resident memory shows how the allocator takes it from the system, not what is kept."""
_A_FRAME = 40
_FRAMES_A_SITUATION = 15


class GroundOutcome(NamedTuple):
    """What a campaign came to.

    Attributes:
        sent: Messages, by the state that they met.
        accepted: How many commands were accepted.
        kinds: How many different commands those were.
        flown_s: Simulated time.
        memory_mib: Resident memory after half of the messages and at the end.
        failures: What did not hold, in words.
    """

    sent: dict[State, int]
    accepted: int
    kinds: int
    flown_s: float
    memory_mib: tuple[float, float]
    failures: list[str]


def ground_campaign(quota: int, *, seed: int, files: Files | None = None) -> GroundOutcome:
    """Fire `quota` messages, the same number in every situation; the vehicle writes to `files`; None: to memory."""
    chance = random.Random(seed)
    target = Target(chance, files)
    sent = 0
    memory_mib: list[float] = []
    failures: list[str] = []
    while sent < quota and not failures:
        for situation in SITUATIONS:
            try:
                sent += _fire(target, situation, chance, min(quota - sent, _A_FRAME * _FRAMES_A_SITUATION))
            except BrokenError as broken:
                failures.append(f"{situation}, message {target.sent.total()}: {broken}")
                break
            except Exception:  # whatever the vehicle raises is what this looks for
                failures.append(f"{situation}, message {target.sent.total()}:\n{format_exc()}")
                break
        if sent >= 0.5 * quota:
            memory_mib.append(_memory_mib())
    failures += [f"{state} never met a message" for state in SITUATIONS if not target.sent[state]]
    memory_mib = memory_mib or [_memory_mib()]
    failures += ["it grew"] * (quota >= FEWEST_FOR_MEMORY and growth_mib(memory_mib) > MAX_GROWTH_MIB)
    kinds, accepted = len(target.accepted), target.accepted.total()
    memory = (memory_mib[0], memory_mib[-1])
    return GroundOutcome(dict(target.sent), accepted, kinds, target.flight.time_s, memory, failures)


def growth_mib(samples: Sequence[float]) -> float:
    """Return by how much memory grows over samples at equal intervals, as a leak does: again and again.

    That is the median growth from one sixth of them to the next, five times. A single step, by which the allocator gets
    its next piece of memory, counts for nothing, whenever it comes.
    """
    sixths = [samples[i * len(samples) // 6 : (i + 1) * len(samples) // 6] for i in range(6)]
    if not all(sixths):
        return 0.0
    return 5.0 * median(median(b) - median(a) for a, b in pairwise(sixths))


def _fire(target: Target, situation: State, chance: random.Random, quota: int) -> int:
    """Fire up to `quota` messages in a situation, or until that is no longer of use; return how many."""
    target.prepare(situation)
    sent = 0
    while sent < quota and not target.lost:
        for _ in range(min(_A_FRAME, quota - sent)):
            target.shoot(target.messages.any(), chance.randrange(3))
            sent += 1
        target.step()
    return sent


def _memory_mib() -> float:
    gc.collect()
    return float(psutil.Process().memory_info().rss / 2**20)
