"""Messages from ground stations, fired at a vehicle in every mode."""

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
from tools.fuzz.vehicle import SITUATIONS, BrokenError, FuzzedVehicle

MAX_GROWTH_MIB = 4.0
FEWEST_FOR_MEMORY = 200_000
"""With fewer messages, resident memory shows the allocator's habits instead of leaks."""
_A_FRAME = 40
_FRAMES_A_SITUATION = 15


class GroundOutcome(NamedTuple):
    sent: dict[State, int]
    accepted: int
    kinds: int  # of commands accepted
    flown_s: float
    memory_mib: tuple[float, float]  # after half of the messages and at the end
    failures: list[str]


def ground_campaign(quota: int, *, seed: int, files: Files | None = None) -> GroundOutcome:
    chance = random.Random(seed)
    target = FuzzedVehicle(chance, files)
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
    """Return the growth of memory by a leak: repeated growth counts, one step of the allocator does not."""
    sixths = [samples[i * len(samples) // 6 : (i + 1) * len(samples) // 6] for i in range(6)]
    if not all(sixths):
        return 0.0
    return 5.0 * median(median(b) - median(a) for a, b in pairwise(sixths))


def _fire(target: FuzzedVehicle, situation: State, chance: random.Random, quota: int) -> int:
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
