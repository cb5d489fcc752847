"""Learn to hover with body rates in wind, by CMA-ES, in ten minutes; fly the policy over MAVLink as a control law.

Prints:
    lost: None, RMS 0.08 m in wind of 5 m/s
"""

import sys

import cma  # pip install cma "colibri-sitl[gym,onnx]"
import numpy as np

import colibri.gym

COUNT, DRAW = 120, {"wind": {"choice": ["0@0", "5@0", "5@90", "5@180", "5@270"]}}
SCALE = np.repeat([5.0, 2.0, 1.0, 0.5, 1.0], [3, 3, 9, 3, 5])  # position, velocity, attitude, rates, last action and 1


def near(now):
    return now.rewards - 0.5 * np.linalg.norm(now.states[:, 6:9] - now.references[:, :3], axis=1)


def costs(policies, seed):
    weights = np.repeat(np.array(policies).reshape(-1, 4, SCALE.size) * SCALE, 5, axis=0)
    seen, _ = envs.reset(seed=[seed + k % 5 for k in range(COUNT)])
    flying, total = np.ones(COUNT, dtype=bool), np.zeros(COUNT)
    while flying.any():
        actions = np.tanh(np.einsum("nij,nj->ni", weights[..., :-1], seen) + weights[..., -1])
        seen, rewards, terminated, truncated, _ = envs.step(actions)
        total, flying = total + flying * rewards, flying & ~(terminated | truncated)
    return -total.reshape(-1, 5).mean(axis=1) / 250


envs = colibri.gym.QuadrotorVectorEnv(COUNT, action="rates", rate=100.0, duration=2.5, draw=DRAW, reward=near)
search = cma.CMAEvolutionStrategy(np.zeros(4 * SCALE.size), 0.2, {"popsize": COUNT // 5, "seed": 1, "verbose": -9})
for generation in range(int((*sys.argv, "1600")[1])):
    search.tell(policies := search.ask(), costs(policies, 5 * generation))
weights = search.result.xfavorite.reshape(4, -1) * SCALE
colibri.gym.export_policy("policy.onnx", envs, [(weights[:, :-1], weights[:, -1])])
flight = colibri.fly("hover", controller="policy.onnx", wind="5@270", duration=20, link="udp")
print(f"lost: {flight.lost}, RMS {flight.report['rmse_m']:.2f} m in wind of 5 m/s")
