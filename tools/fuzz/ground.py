"""The campaign against the ground-station side: messages fired at a vehicle in every mode it has."""

import gc
import random
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
        memory_mib: Resident memory after half of the messages and at the end. Of a million it takes one step of 18 MiB,
            not explained, before a quarter of them, and is flat from there on; a leak would go on.
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
    sent, before = 0, None
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
        if before is None and sent >= 0.5 * quota:
            before = _memory_mib()
    after = _memory_mib()
    failures += [f"{state} never met a message" for state in SITUATIONS if not target.sent[state]]
    failures += ["it grew"] * (quota >= FEWEST_FOR_MEMORY and after - (before or after) > MAX_GROWTH_MIB)
    memory = (before or after, after)
    kinds, accepted = len(target.accepted), target.accepted.total()
    return GroundOutcome(dict(target.sent), accepted, kinds, target.flight.time_s, memory, failures)


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
