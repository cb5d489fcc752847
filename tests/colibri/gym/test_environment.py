"""Learning environments: gymnasium's checker, equal bits in vectors of any size, snapshots, ends, refusals."""

import sys
import warnings
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from colibri.common.errors import Error
from colibri.gym import GymTransition, QuadrotorEnv, QuadrotorVectorEnv
from colibri.mavlink.links.open import open_link
from colibri.mavlink.wire.dialect import Codec
from colibri.plant.vehicle.description import load_vehicle
from tests.support.refusals import refusal_of

_DRAW: dict[str, Any] = {"wind": {"choice": ["5@270", "2@0"]}, "vehicle.body.mass_kg": {"uniform": [0.6, 0.7]}}
_RACE: dict[str, Any] = {
    "gates": [(0, 0, 9), (1, 0, 9), (1, 1, 9)],
    "start": "thrown",
    "action": "rates",
    "preview": 1,
    "history": 2,
}
_STEPS, _BEYOND = 60, -1.0


def _flown(count: int, seed: int, **options: Any) -> list[bytes]:
    """Return the bits of each row's observations, rewards and ends."""
    env = QuadrotorVectorEnv(count, duration=0.16, **options)
    actions = np.random.default_rng(5).uniform(-1.0, 1.0, (_STEPS, 4)).astype(np.float32)
    actions[30:33, 2] = np.nan  # ends an episode before its time
    parts = [[row.tobytes()] for row in env.reset(seed=seed)[0]]
    for action in actions:
        results = env.step(np.tile(action, (count, 1)))[:4]
        for n, part in enumerate(parts):
            part += [np.asarray(each[n]).tobytes() for each in results]
    return [b"".join(part) for part in parts]


@pytest.mark.parametrize(
    "options",
    [
        {"id": "colibri/Hover-v0", "history": 4},
        {"id": "colibri/Track-v0", "action": "rates", "preview": 3},
        {"id": "colibri/Hover-v0", "action": "velocity", "observation": "estimate", "preview": 2, "history": 2},
        {"id": "colibri/Track-v0", "action": "position", "draw": _DRAW},
        pytest.param({"id": "colibri/Recover-v0", "vehicle": "firefly", "history": 2}, marks=pytest.mark.long),
        pytest.param({"id": "colibri/Recover-v0", "action": "attitude"}, marks=pytest.mark.long),
        {"id": "colibri/Race-v0", "action": "rates"},
    ],
)
def test_checker_of_gymnasium_passes(options: dict[str, Any]) -> None:
    env = gymnasium.make(**options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    envs = gymnasium.make_vec(num_envs=2, **options)
    assert isinstance(envs, QuadrotorVectorEnv) == (options.get("action") in (None, "rates"))
    assert envs.reset(seed=5)[0][1].tobytes() == env.reset(seed=6)[0].tobytes()


@pytest.mark.parametrize(
    "options", [{}, {"action": "rates", "draw": _DRAW, "track": "circle:speed=3", "preview": 2}, _RACE]
)
def test_vectors_of_any_size_give_equal_bits(options: dict[str, Any]) -> None:
    seven = _flown(7, 11, **options)
    assert len(set(seven)) == 7
    assert [_flown(1, 11 + n, **options)[0] for n in range(7)] == seven
    assert _flown(64, 11, **options, threads=3)[:7] == seven


def test_one_vehicle_has_the_bits_of_a_vector() -> None:
    one, several = QuadrotorEnv(draw=_DRAW), QuadrotorVectorEnv(3, draw=_DRAW)
    seen, rows = one.reset(seed=6)[0], several.reset(seed=4)[0]
    for k in range(40):
        assert seen.tobytes() == rows[2].tobytes()
        action = np.full((3, 4), 0.01 * k, dtype=np.float32)
        seen, rows = one.step(action[2])[0], several.step(action)[0]


def test_restored_episodes_continue_with_the_same_bits() -> None:
    env = QuadrotorVectorEnv(3, duration=0.1, draw=_DRAW)
    actions = np.zeros((3, 4), dtype=np.float32)
    env.reset(seed=2)
    env.step(actions)
    kept = env.snapshot()
    first = [env.step(actions)[0].tobytes() for _ in range(_STEPS)]  # beyond ends: draws are restored as well
    other = QuadrotorVectorEnv(3, duration=0.1, draw=_DRAW)
    for again in (env, other):
        again.restore(kept)
        assert [again.step(actions)[0].tobytes() for _ in range(_STEPS)] == first
    with pytest.raises(Error, match="snapshot must come from"):
        QuadrotorEnv().restore(kept)


@pytest.mark.parametrize("observation", [pytest.param("truth", marks=pytest.mark.long), "estimate"])
def test_actions_through_the_autopilot_are_exact(observation: str) -> None:
    env, other = (QuadrotorEnv(action="velocity", observation=observation, draw=_DRAW) for _ in range(2))
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 4)).astype(np.float32)
    seen = [_episode(each, seed, actions) for each in (env, other) for seed in (3, 4, 3)]
    assert seen[0] == seen[2] == seen[3] == seen[5]
    assert seen[1] == seen[4] != seen[0]
    env.step(actions[0])
    kept = env.snapshot()
    first = [env.step(action)[0].tobytes() for action in actions]
    env.reset(seed=9)
    env.restore(kept)
    assert [env.step(action)[0].tobytes() for action in actions] == first
    with pytest.raises(Error, match="snapshot must come from"):
        other.restore(kept)


def _episode(env: QuadrotorEnv, seed: int, actions: Any) -> list[bytes]:
    return [env.reset(seed=seed)[0].tobytes(), *(env.step(action)[0].tobytes() for action in actions)]


@pytest.mark.parametrize(
    ("action", "given", "places", "expected"),
    [
        ("velocity", (0.2, 0.0, 0.25, 0.0), slice(3, 6), (1.0, 0.0, 0.5)),
        ("position", (0.5, 0.0, 0.25, 0.0), slice(0, 3), (1.0, 0.0, 0.5)),
        ("attitude", (0.0, 0.5, 0.0, 0.0), slice(12, 15), (0.0, np.sin(np.radians(17.5)), np.cos(np.radians(17.5)))),
    ],
)
def test_the_autopilot_flies_what_an_action_demands(
    action: str, given: tuple[float, ...], places: slice, expected: tuple[float, ...]
) -> None:
    env = QuadrotorEnv(action=action, draw={"start.x": 0.0, "start.y": 0.0, "start.z": 0.0}, limit_m=20.0)
    env.reset(seed=1)
    for _ in range(150 if action == "position" else 40):
        seen, _, ended, _, info = env.step(np.array(given, dtype=np.float32))
        assert not ended
    assert info["mode"] == "offboard"
    row = seen[places] if action != "attitude" else [seen[8], seen[11], -seen[14]]
    assert np.abs(np.abs(row) - expected).max() < 0.03


def test_estimates_differ_from_the_truth() -> None:
    env = QuadrotorEnv(action="velocity", observation="estimate")
    seen, _ = env.reset(seed=1)
    error = np.linalg.norm(seen[:3] - QuadrotorEnv(action="velocity").reset(seed=1)[0][:3])
    assert 0.0 < error < 1.0


def test_a_race_is_flown_through_its_gates(tmp_path: Path) -> None:
    gates = tmp_path / "gates.csv"
    gates.write_text("x,y,z\n0,0,2\n4,0,2\n4,4,3\n0,4,2\n")
    env = QuadrotorEnv(gates=str(gates), action="velocity", preview=2, draw=_DRAW, duration=30.0)
    seen, _ = env.reset(seed=2)
    assert np.abs(seen[22:28] - [0.0, 4.0, 1.0, -4.0, 4.0, 0.0] + np.tile(seen[:3], 2)).max() < 1e-5
    rewards, ended = [], False
    while not ended:
        action = np.zeros(4, dtype=np.float32)
        action[:3] = -(seen[:3] - _BEYOND * seen[:3] / np.linalg.norm(seen[:3])) / (5.0, 5.0, 2.0)
        seen, reward, ended, truncated, info = env.step(np.clip(action, -0.4, 0.4))
        rewards.append(reward)
        assert not truncated
    assert info["why"] == "finished"
    assert sum(reward > 5.0 for reward in rewards) == 3


def test_a_gate_missed_ends_the_race() -> None:
    env = QuadrotorEnv(gates=[(0, 0, 2), (2, 1.5, 2), (3, 1.5, 2)], action="velocity")
    env.reset(seed=1)
    ended = False
    while not ended:
        *_, reward, ended, _, info = env.step(np.array([0.2, 0.0, 0.0, 0.0], dtype=np.float32))
    assert (info["why"], reward) == ("gate missed", -10.0)


def test_history_and_preview_are_behind_the_state() -> None:
    env = QuadrotorEnv(track="circle:radius=2,speed=2", preview=2, history=3)
    env.reset(seed=1)
    actions = [np.full(4, 0.1 * k, dtype=np.float32) for k in range(4)]
    for action in actions:
        seen, *_ = env.step(action)
    assert seen[18:22].tolist() == actions[3].tolist()
    assert seen[28:].tolist() == [*actions[2].tolist(), *actions[1].tolist()]
    assert np.linalg.norm(seen[25:28] - seen[22:25]) == pytest.approx(0.2, abs=1e-3)


def test_a_simple_law_hovers_with_rates() -> None:
    env = QuadrotorEnv(action="rates")
    vehicle = load_vehicle("hummingbird")
    seen, _ = env.reset(seed=3)
    for _ in range(1500):
        R = seen[6:15].reshape(3, 3).astype(float)
        force = -4.0 * seen[:3] - 4.0 * seen[3:6] + np.array([0.0, 0.0, vehicle.gravity_m_s2])
        tilt = R.T @ np.cross(R[:, 2], force / np.linalg.norm(force))
        thrust = 2.0 * vehicle.body.mass_kg * (force @ R[:, 2]) / vehicle.max_wrench()[0] - 1.0
        seen, reward, terminated, truncated, _ = env.step(np.array([thrust, tilt[0], tilt[1], 0.0], dtype=np.float32))
        assert not terminated
        assert not truncated
    assert np.linalg.norm(seen[:3]) < 0.02
    assert reward > 0.95


@pytest.mark.parametrize(
    ("action", "options", "why"),
    [
        (np.nan, {}, "action not finite"),
        (np.inf, {"action": "rates"}, "action not finite"),
        (-1.0, {}, "ground"),
        (1.0, {"limit_m": 2.0}, "too far from the reference"),
    ],
)
def test_episode_ends_and_says_why(action: float, options: dict[str, Any], why: str) -> None:
    env = QuadrotorEnv(**options)
    env.reset(seed=1)
    for _ in range(1000):
        seen, reward, terminated, _, info = env.step(np.full(4, action, dtype=np.float32))
        assert env.observation_space.contains(seen)
        if terminated:
            break
    assert (info["why"], reward) == (why, -10.0)
    with pytest.raises(Error, match=r"reset\(\) is required"):
        env.step(np.zeros(4, dtype=np.float32))


def test_reward_can_be_replaced() -> None:
    def height(now: GymTransition) -> Any:
        return now.states[:, 8]

    env = QuadrotorEnv(reward=height)
    seen, _ = env.reset(seed=1)
    seen, reward, *_ = env.step(np.zeros(4, dtype=np.float32))
    assert reward == pytest.approx(2.0 + seen[2], abs=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"action": "rate"}, 'unknown action "rate" (did you mean "rates"?)'),
        ({"rat": 3}, 'unknown keyword "rat" (did you mean "rate"?)'),
        ({"rate": float("nan")}, "rate must be a number from 10 to 1000 Hz"),
        ({"duration": -1}, "duration must be a number"),
        ({"preview": 1.5}, "preview must be a whole number"),
        ({"max_rates": (1, 2)}, "max_rates must be three numbers"),
        ({"reward": 3}, "reward must be a function"),
        ({"vehicle": "humingbird"}, "humingbird"),
        ({"track": "sprial"}, "sprial"),
        ({"render_mode": "humn"}, 'unknown render_mode "humn" (did you mean "human"?)'),
        ({"threads": 0}, "threads must be a whole number from 1"),
        ({"history": 0}, "history must be a whole number from 1"),
        ({"observation": "estimate"}, 'keyword "observation" requires an action through the autopilot'),
        ({"action": "velocity", "observation": "truht"}, 'unknown observation "truht" (did you mean "truth"?)'),
        ({"action": "velocity", "profil": "se3"}, 'unknown keyword "profil" (did you mean "profile"?)'),
        ({"action": "velocity", "profile": "fligt"}, "fligt"),
        ({"action": "velocity", "max_velocity": 3}, "max_velocity must be four numbers"),
        ({"action": "velocity", "rate": 500.0}, "rate must be at most"),
        ({"action": "velocity", "observation": "estimate", "draw": {"start.p": 1.0}}, "only x, y and z"),
        ({"gates": "nowhere.csv"}, "nowhere.csv: No such file"),
        ({"gates": [(0, 0, 2)]}, "gates must be a waypoint file"),
        ({"gates": [(0, 0, 2), (0, 0, 2)]}, "two points in a row"),
        ({"gates": [(0, 0, 2), (1, 0, 2)], "track": "hover"}, "track must be left out"),
        ({"start": "throw"}, 'unknown start "throw" (did you mean "thrown"?)'),
        ({"draw": {"lost": 4}}, "lost must be a rotor, 0 to 3"),
        ({"draw": [1]}, "draw must be a table"),
        ({"draw": {"start.w": 1}}, 'unknown key of draw "start.w"'),
        ({"draw": {"start.x": {"uniform": [2, 1]}}}, "empty range"),
        ({"draw": {"start.x": "a"}}, "start.x must be a number"),
        ({"draw": {"start.z": -3.0}}, "below the ground"),
        ({"draw": {"wind": "fast"}}, "draw: wind"),
        ({"draw": {"vehicle.body.mass": 1.0}}, "body.mass"),
    ],
)
def test_wrong_keywords_get_one_line(options: dict[str, Any], message: str) -> None:
    assert message in refusal_of(QuadrotorEnv, **options)


@pytest.mark.parametrize("action", ["rotors", "velocity"])
def test_pictures_show_the_flight(action: str) -> None:
    env = QuadrotorEnv(action=action, render_mode="rgb_array", gates=[(0, 0, 2), (2, 0, 2)])
    with pytest.raises(Error, match=r"reset\(\) is required"):
        env.render()
    env.reset(seed=1)
    first = env.render()
    env.step(np.ones(4, dtype=np.float32))
    assert (first.shape, first.dtype) == ((480, 640, 3), np.uint8)
    assert (env.render() != first).any()
    with pytest.raises(Error, match="render_mode must be None in a compiled vector"):
        gymnasium.make_vec("colibri/Hover-v0", 2, render_mode="rgb_array")


def test_the_live_page_is_sent_each_step(monkeypatch: pytest.MonkeyPatch) -> None:
    popen = Mock()
    monkeypatch.setattr("colibri.gym.render.subprocess.Popen", popen)
    env = QuadrotorEnv(render_mode="human")
    with closing(open_link(popen.call_args.args[0][-1])) as page:
        env.reset(seed=1)
        env.step(np.zeros(4, dtype=np.float32))
        codec = Codec(255, 190)
        messages = [message for datagram, _ in page.receive_now() for message in codec.decode(datagram)]
    env.close()
    places = [message.fields for message in messages if message.name == "LOCAL_POSITION_NED"]
    x = env.episodes.x[0]
    assert (places[-1].y, places[-1].x, places[-1].z) == pytest.approx((x[6], x[7], -x[8]))
    assert messages[0].name == "HEARTBEAT"
    assert len(messages) == 7


def test_missing_gymnasium_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "colibri.gym")
    with pytest.raises(ImportError, match=r"pip install 'colibri-sitl\[gym\]'"):
        import_module("colibri.gym")


def test_wrong_actions_and_seeds_get_one_line() -> None:
    one, several = QuadrotorEnv(), QuadrotorVectorEnv(2)
    one.reset(seed=0)
    several.reset(seed=0)
    with pytest.raises(Error, match="must have the shape"):
        one.step(np.zeros(3, dtype=np.float32))
    with pytest.raises(Error, match="must have the shape"):
        several.step(np.zeros((1, 4), dtype=np.float32))
    with pytest.raises(Error, match="seed must be"):
        several.reset(seed=[1])
    wrong: list[Any] = [-1, 1.5, True, "a"]
    for seed in wrong:
        for reset in (one.reset, several.reset):
            with pytest.raises(Error, match="seed must be"):
                reset(seed=seed)
