"""The environments of gymnasium: one vehicle, or a compiled vector."""

from collections.abc import Sequence
from functools import partial
from inspect import signature
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from colibri.autopilot.control.parts.policy_interface import MAX_POSITION_M, MAX_RATE_RAD_S, MAX_SPEED_M_S
from colibri.common.errors import shown, unknown
from colibri.gym.arguments import GymError
from colibri.gym.episodes import PILOTED, Episodes, EpisodesSnapshot

Values = NDArray[np.float32]
_MAX_COUNT = 100_000
_RENDER_MODES = ("human", "rgb_array")


class QuadrotorEnv(gymnasium.Env[Values, Values]):
    """One vehicle; keywords, observations and rewards are in docs/gym.md."""

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012 - declared by gymnasium

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        if render_mode not in (None, *_RENDER_MODES):
            raise GymError(unknown("render_mode", render_mode, _RENDER_MODES))
        self.episodes = _episodes(1, options)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.episodes.interval_s)}
        self.render_mode = render_mode
        self._picture: Any = None
        if render_mode is not None:
            from colibri.gym import render  # loads Matplotlib

            self._picture = {"human": render.LivePage, "rgb_array": render.Picture}[render_mode](self.episodes)
        self.observation_space, self.action_space = _spaces(self.episodes)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Values, dict[str, Any]]:
        """Begin an episode; the same seed gives the same bits. `options` must be empty."""
        super().reset(seed=_seed(seed))
        if options:
            raise GymError(f'options: none are known, not "{shown(options)}": distributions are the keyword draw')
        self.episodes.begin(0, self.np_random)
        if self._picture is not None:
            self._picture.begin()
        return self.episodes.observations[0].copy(), self.episodes.info()

    def step(self, action: Values) -> tuple[Values, float, bool, bool, dict[str, Any]]:
        """Advance one control interval; `info["why"]` names the reason of a termination."""
        episodes = self.episodes
        if not episodes.flying[0]:
            raise GymError("reset() is required: no episode is running")
        given = np.asarray(action)
        if given.shape != self.action_space.shape:
            raise GymError(f"action must have the shape {self.action_space.shape}, not {given.shape}")
        rewards, terminated, truncated = episodes.step(given[None])
        if self._picture is not None:
            self._picture.step()
        seen: Values = episodes.observations[0].copy()
        return seen, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), episodes.info()

    def render(self) -> Any:
        """Return the picture of `rgb_array`, (480, 640, 3); with `human` the page shows each step by itself."""
        if self._picture is None:
            raise GymError('render_mode "rgb_array" or "human" is required when the environment is made')
        if not self.episodes.flying.any() and not self.episodes.at.any():
            raise GymError("reset() is required: no episode is running")
        return self._picture.draw()

    def close(self) -> None:
        if self._picture is not None:
            self._picture.close()

    def snapshot(self) -> EpisodesSnapshot:
        """Keep the episode, with its random numbers."""
        return self.episodes.snapshot()

    def restore(self, snapshot: EpisodesSnapshot) -> Values:
        """Continue from a snapshot with the same bits; return its observation."""
        self.episodes.restore(snapshot, [self.np_random])
        seen: Values = self.episodes.observations[0].copy()
        return seen


class QuadrotorVectorEnv(VectorEnv[Values, Values, Any]):
    """A vector of vehicles; row i seeded with `seed + i` has the bits of one vehicle with that seed.

    A row that has ended is reset in the next step, whose action it ignores (`AutoresetMode.NEXT_STEP`).
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(self, num_envs: int = 1, *, render_mode: str | None = None, **options: Any) -> None:
        if render_mode is not None:
            raise GymError(f'render_mode must be None in a compiled vector, not "{shown(render_mode)}"')
        self.episodes = _episodes(_count(num_envs), options)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = _spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._chances = [seeding.np_random(None)[0] for _ in range(num_envs)]
        self._begun = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Values, dict[str, Any]]:
        """Begin the episodes of all rows, or of those in `options["reset_mask"]`, (n,)."""
        count = self.num_envs
        if isinstance(seed, Sequence) and not isinstance(seed, str):
            seeds = [_seed(each) for each in seed]
        else:
            first = _seed(seed)
            seeds = [None if first is None else first + n for n in range(count)]
        if len(seeds) != count:
            raise GymError(f"seed must be one number or {count}, not {len(seeds)}")
        mask = np.asarray((options or {}).get("reset_mask", np.ones(count, dtype=np.bool_)))
        if set(options or {}) - {"reset_mask"} or mask.shape != (count,) or mask.dtype != np.bool_:
            raise GymError(f'options: only reset_mask is known, ({count},) of bool, not "{shown(options)}"')
        for n in np.flatnonzero(mask).tolist():
            if seeds[n] is not None:
                self._chances[n] = seeding.np_random(seeds[n])[0]
            self.episodes.begin(n, self._chances[n])
        self._begun = self._begun or bool(mask.all())
        return self.episodes.observations.copy(), {}

    def step(
        self, actions: Values
    ) -> tuple[Values, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advance all rows one control interval; `infos["why"]` names the reasons of terminations."""
        if not self._begun:
            raise GymError("reset() is required: no episode is running")
        episodes = self.episodes
        waiting = np.flatnonzero(~episodes.flying).tolist()
        rewards, terminated, truncated = episodes.step(actions)
        for n in waiting:
            episodes.begin(n, self._chances[n])
        infos: dict[str, Any] = {}
        if terminated.any():
            infos = {"why": np.array([episodes.why(n) for n in range(self.num_envs)], dtype=object), "_why": terminated}
        return episodes.observations.copy(), rewards, terminated, truncated, infos

    def snapshot(self) -> EpisodesSnapshot:
        """Keep the episodes of all rows, with their random numbers."""
        return self.episodes.snapshot()

    def restore(self, snapshot: EpisodesSnapshot) -> Values:
        """Continue from a snapshot with the same bits; return its observations."""
        self.episodes.restore(snapshot, self._chances)
        self._begun = True
        return self.episodes.observations.copy()


def vector_env(num_envs: int = 1, **options: Any) -> VectorEnv[Values, Values, Any]:
    """Return the vector of `gymnasium.make_vec`, compiled unless actions go through the autopilot."""
    if options.get("action") in PILOTED:
        return SyncVectorEnv([partial(QuadrotorEnv, **options)] * _count(num_envs))
    return QuadrotorVectorEnv(num_envs, **options)


def _count(given: Any) -> int:
    if isinstance(given, bool) or not isinstance(given, int) or not 1 <= given <= _MAX_COUNT:
        raise GymError(f'num_envs must be a whole number from 1 to {_MAX_COUNT}, not "{shown(given)}"')
    return given


def _episodes(count: int, options: dict[str, Any]) -> Episodes:
    piloted = options.get("action") in PILOTED
    names = [*signature(Episodes).parameters][1:]
    if piloted or not options.keys() <= {*names}:
        from colibri.gym.piloted import PilotedEpisodes  # loads the autopilot

        own = [name for name in signature(PilotedEpisodes).parameters if name not in ("count", "options")]
        for name in options:
            if name not in (*names, *own):
                raise GymError(unknown("keyword", name, [*names, *own]))
            if not piloted and name not in names:
                raise GymError(f'keyword "{name}" requires an action through the autopilot: {", ".join(PILOTED)}')
        return PilotedEpisodes(count, **options)
    return Episodes(count, **options)


def _seed(given: Any) -> int | None:
    if given is None or (isinstance(given, int | np.integer) and not isinstance(given, bool) and given >= 0):
        return None if given is None else int(given)
    raise GymError(f'seed must be a whole number, 0 at least, not {type(given).__name__} "{shown(given)}"')


def _spaces(episodes: Episodes) -> tuple[Space[Values], Space[Values]]:
    state = (*[MAX_POSITION_M] * 3, *[MAX_SPEED_M_S] * 3, *[1.0] * 9, *[MAX_RATE_RAD_S] * 3, *[1.0] * episodes.size)
    beyond = [*[MAX_POSITION_M] * 3 * episodes.preview, *[1.0] * episodes.size * (episodes.history - 1)]
    most = np.array([*state, *beyond], dtype=np.float32)
    spaces: Any = (Box(-most, most, dtype=np.float32), Box(-1.0, 1.0, (episodes.size,), dtype=np.float32))
    return spaces[0], spaces[1]
