"""Plan by trying: fly some velocities for half a second each, go back, and fly the best one for a quarter.

Needs `colibri-sitl[gym]`. Every trial is flown by the whole autopilot in wind that the plan does not know.

Prints:
    finished after 2.25 s, 9 plans of 8 trials
"""

from itertools import product

import gymnasium
import numpy as np

import colibri.gym  # noqa: F401

GATES = [(0, 0, 2), (2, 0, 2), (3, 2, 3)]
TRIALS = [np.array([x, y, z, 0.0], dtype=np.float32) for x, y, z in product((0.0, 0.4), (0.0, 0.4), (0.0, 0.5))]


def flown(env, action, steps):
    """Return the rewards of a constant velocity, and why the episode ended."""
    total, ended, info = 0.0, False, {}
    while steps and not ended:
        _, reward, ended, _, info = env.step(action)
        total, steps = total + reward, steps - 1
    return total, info.get("why")


env = gymnasium.make("colibri/Race-v0", gates=GATES, action="velocity", rate=20, draw={"wind": "4@0"}).unwrapped
env.reset(seed=1)
plans, why = 0, None
while not why:
    now, best = env.snapshot(), (-np.inf, TRIALS[0])
    for trial in TRIALS:
        best = max(best, (flown(env, trial, 10)[0], trial), key=lambda pair: pair[0])
        env.restore(now)
    plans, why = plans + 1, flown(env, best[1], 5)[1]
print(f"{why} after {env.episodes.steps[0] / 20:.2f} s, {plans} plans of {len(TRIALS)} trials")
