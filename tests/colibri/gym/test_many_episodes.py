"""A thousand episodes in vectors and processes of any number: equal bits, and flat memory."""

import gc
import tracemalloc
from concurrent.futures import ProcessPoolExecutor
from hashlib import sha256
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

from colibri.gym import QuadrotorEnv, QuadrotorVectorEnv

_EPISODES = 1000
_OPTIONS: dict[str, Any] = {
    "action": "rates",
    "rate": 100.0,
    "duration": 1.0,
    "draw": {
        "wind": {"choice": ["0@0", "5@45"]},
        "vehicle.body.mass_kg": {"uniform": [0.6, 0.8]},
        "lost": {"choice": [-1, 2]},
    },
    "history": 2,
}


def _hashes(first: int, last: int, size: int) -> list[str]:
    """Fly episodes by their seeds in a vector of `size`; return the hash of each."""
    env, found = QuadrotorVectorEnv(size, **_OPTIONS), []
    for seed in range(first, last, size):
        seen, _ = env.reset(seed=seed)
        hashes, flying = [sha256(row.tobytes()) for row in seen], np.ones(size, dtype=np.bool_)
        while flying.any():
            seen, rewards, terminated, truncated, _ = env.step(np.clip(-0.4 * seen[:, 2:6], -1.0, 1.0))
            for n in np.flatnonzero(flying):
                hashes[n].update(seen[n].tobytes() + rewards[n].tobytes())
            flying &= ~(terminated | truncated)
        found += [each.hexdigest() for each in hashes]
    return found[: last - first]


@pytest.mark.long
def test_a_thousand_episodes_have_the_same_bits() -> None:
    expected = _hashes(0, _EPISODES, 1)
    assert len(set(expected)) == _EPISODES
    half = _EPISODES // 2
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for size in (7, 64):
            assert _hashes(0, _EPISODES, size) == expected
        for size in (1, 7, 64):
            halves = [*pool.map(_hashes, (0, half), (half, _EPISODES), (size, size))]
            assert halves == [expected[:half], expected[half:]]


@pytest.mark.long
@pytest.mark.parametrize(("action", "resets"), [("rotors", 1000), ("velocity", 500)])
def test_memory_is_flat_over_resets(action: str, resets: int) -> None:
    env = QuadrotorEnv(action=action)
    sizes = []
    tracemalloc.start()
    for seed in range(2 * resets):
        env.reset(seed=seed)
        env.step(np.zeros(4, dtype=np.float32))
        if seed % resets == resets // 2:
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert abs(sizes[1] - sizes[0]) < 20_000  # bytes: an object kept at each reset takes more
