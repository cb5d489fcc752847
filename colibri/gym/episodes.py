"""Episodes of many vehicles, without gymnasium: draws, resets, steps, snapshots."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from colibri.autopilot.control.parts.policy_interface import level_action, observe, scale_of, width
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.autopilot.guidance.trajectories.sampling import sampled_track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.autopilot.spec import Trajectory
from colibri.campaigns.factors import is_number
from colibri.common.errors import shown, unknown
from colibri.common.jit import packed
from colibri.common.types import Array
from colibri.gym import kernels
from colibri.gym.arguments import GymError, gate_points, gates_of, read_draws, wind_of, within
from colibri.plant.environment.turbulence import CALM
from colibri.plant.environment.weather import Wind
from colibri.plant.physics.integrators import RK4_STEP_S
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import parameters_of, starting_world
from colibri.plant.vehicle.description import Vehicle, load_vehicle

ACTIONS = ("rotors", "rates", "attitude", "velocity", "position")
PILOTED = ACTIONS[2:]  # actions through the whole autopilot
ENDS = (
    *("", "too far from the reference", "ground", "state not finite"),
    *("action not finite", "disarmed", "gate missed", "finished"),
)
_COORDINATES = ("x", "y", "z", "vx", "vy", "vz")
_NEAR: dict[str, Any] = {
    **{f"start.{key}": {"uniform": [-0.5, 0.5]} for key in ("x", "y", "z", "vx", "vy", "vz", "p", "q", "r")},
    **{f"start.{key}": {"uniform": [-15.0, 15.0]} for key in ("phi", "theta")},
}
_THROWN: dict[str, Any] = {
    **{f"start.{key}": {"uniform": [-5.0, 5.0]} for key in ("vx", "vy", "vz", "p", "q", "r")},
    **{f"start.{key}": {"uniform": [-180.0, 180.0]} for key in ("phi", "psi")},
    "start.theta": {"uniform": [-90.0, 90.0]},
}


class GymTransition(NamedTuple):
    """One step of n vehicles, for a reward of one's own."""

    observations: NDArray[np.float32]  # (n, values), after the step
    actions: Array  # (n, a), as given
    states: Array  # (n, 14 + rotors), `plant.physics.equations`
    references: Array  # (n, 6), position m and velocity m/s, ENU; of a gate, centre and direction
    rewards: Array  # (n,), the shipped reward
    terminated: NDArray[np.bool_]  # (n,)


Reward = Callable[[GymTransition], Any]
"""Returns the rewards, (n,)."""


class EpisodesSnapshot(NamedTuple):
    """Memory of episodes in mid-air."""

    arrays: tuple[Any, ...]
    chances: tuple[Mapping[str, Any] | None, ...]
    flight: Any = None  # with actions through the autopilot: the environment's flight, and its snapshot


class Begun(NamedTuple):
    """The beginning of an episode as drawn; `lost` is a rotor without thrust, or -1."""

    vehicle: Vehicle
    wind: Wind
    lost: int
    x: Array
    action: Array
    parameters: Any
    mixer: Array
    scale: Array


class Episodes:
    """Episodes of `count` vehicles, each row with its own random numbers; arguments as in docs/gym.md."""

    near: Mapping[str, Any] = _NEAR  # drawn by default

    def __init__(
        self,
        count: int,
        *,
        track: Any = None,
        gates: Any = None,
        gate_m: float = 0.75,
        start: str = "near",
        vehicle: str | Vehicle = "hummingbird",
        action: str = "rotors",
        rate: float = 250.0,
        duration: float = 10.0,
        preview: int = 0,
        preview_s: float = 0.1,
        history: int = 1,
        max_rates: Sequence[float] = (8.0, 8.0, 4.0),
        limit_m: float = 5.0,
        draw: Mapping[str, Any] | None = None,
        reward: Reward | None = None,
        threads: int = 1,
    ) -> None:
        if action not in ACTIONS:
            raise GymError(unknown("action", action, ACTIONS))
        within("rate", rate, 10.0, 1000.0, "Hz")
        within("duration", duration, 1.0 / rate, 3600.0, "s")
        within("limit_m", limit_m, 0.1, 1000.0, "m")
        within("preview_s", preview_s, 1.0 / rate, 10.0, "s")
        for name, whole, least in (("preview", preview, 0), ("history", history, 1), ("threads", threads, 1)):
            if isinstance(whole, bool) or not isinstance(whole, int) or not least <= whole <= 100:
                raise GymError(f'{name} must be a whole number from {least} to 100, not "{shown(whole)}"')
        if not isinstance(max_rates, Sequence) or len(max_rates) != 3 or not all(map(is_number, max_rates)):
            raise GymError(f'max_rates must be three numbers, rad/s, not "{shown(max_rates)}"')
        for value in max_rates:
            within("max_rates", value, 0.1, 50.0, "rad/s")
        if reward is not None and not callable(reward):
            kind = type(reward).__name__
            raise GymError(f'reward must be a function of a GymTransition, not {kind} "{shown(reward)}"')
        self.count, self.interval_s, self.preview, self.history = count, 1.0 / rate, preview, history
        self.length = max(1, round(duration * rate))
        self.action, self._reward, self._limit_m = action, reward, float(limit_m)
        self._stride = max(1, round(preview_s * rate))
        self._substeps = max(1, ceil(self.interval_s / RK4_STEP_S - 1e-6))
        self.max_rates, self.preview_s = tuple(map(float, max_rates)), preview_s
        self.vehicle = load_vehicle(vehicle)
        rotors = self.vehicle.rotors.count
        self.size = rotors if action == "rotors" else 4
        self._floor_m = -np.inf if self.vehicle.ground is None else 0.0
        if start not in ("near", "thrown"):
            raise GymError(unknown("start", start, ("near", "thrown")))
        within("gate_m", gate_m, 0.05, 100.0, "m")
        edges = np.linspace(0, count, min(threads, count) + 1).round().astype(int).tolist()
        self._parts = [slice(*pair) for pair in pairwise(edges)]
        self._pool = ThreadPoolExecutor(threads) if len(self._parts) > 1 else None
        self._last_built: tuple[list[tuple[str, Any]], tuple[Any, ...]] | None = None
        self.gate_m = 0.0 if gates is None else float(gate_m)
        if gates is None:
            self.reference = self._sampled("hover" if track is None else track, duration)
            self._first = self.reference[0].copy()
        elif track is None:
            points = gate_points(gates)
            self.reference, self._stride = gates_of(points, preview), 1
            self._first = np.array((*points[0], 0.0, 0.0, 0.0))
        else:
            raise GymError(f'track must be left out, not "{shown(track)}", in a race through gates')
        drawn = self.near if start == "near" else {**_THROWN, "lost": {"choice": [-1, *range(rotors)]}}
        self._fixed, self._draws = read_draws(drawn, draw)
        for end in (0, -1):  # both ends of every range must fly
            first = self._drawn({**self._fixed, **{key: each.typical[end] for key, each in self._draws.items()}})
        self.x = np.zeros((count, first.x.size))
        self._last, self._older = np.zeros((count, self.size)), np.zeros((count, history - 1, self.size))
        self.steps, self._passed = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        self._parameters = np.empty(count, dtype=first.parameters.dtype)
        self._mixers, self._scales = np.empty((count, rotors, 4)), np.empty((count, 9))
        self._chances: list[Generator | None] = [None] * count
        self._ends, self._rewards = np.zeros(count, dtype=np.int64), np.zeros(count)
        self.observations = np.zeros((count, width(self.size, preview, history)), dtype=np.float32)
        self.flying = np.zeros(count, dtype=np.bool_)

    def begin(self, n: int, chance: Generator) -> None:
        values = {key: each.value(chance) for key, each in self._draws.items()}
        self._chances[n] = chance
        self._begin(n, self._drawn({**self._fixed, **values}))
        self._older[n] = self._last[n]
        self.steps[n] = self._passed[n] = 0
        self.flying[n] = True
        self._observe(n)

    def _begin(self, n: int, begun: Begun) -> None:
        self.x[n], self._last[n] = begun.x, begun.action
        self._parameters[n], self._mixers[n], self._scales[n] = begun.parameters[0], begun.mixer, begun.scale

    def _observe(self, n: int) -> None:
        k, last, older, out = self.at[n], self._last[n], self._older[n], self.observations[n]
        observe(self._seen(n), last, older, self.reference, k, self._stride, out)

    @property
    def at(self) -> NDArray[np.int64]:
        """Rows of the references, (n,): the next gates, or the intervals flown."""
        return self._passed if self.gate_m else self.steps

    def _seen(self, n: int) -> Array:
        seen: Array = self.x[n]
        return seen

    def step(self, given: Any) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Advance all flying rows; return rewards, terminated, truncated, each (n,)."""
        try:
            actions = np.ascontiguousarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise GymError(f'action must be numbers, ({self.count}, {self.size}), not "{shown(given)}"') from None
        if actions.shape != self._last.shape:
            raise GymError(f"action must have the shape {self._last.shape}, not {actions.shape}")
        self._advance(actions)
        terminated = self._ends != 0
        truncated = self.flying & (self.steps >= self.length) & ~terminated
        rewards = self._rewards.copy()
        if self._reward is not None:
            now = self.reference[self.at, :6]
            seen = GymTransition(
                self.observations.copy(), actions, self.x.copy(), now, rewards.copy(), terminated.copy()
            )
            own = np.asarray(self._reward(seen), dtype=np.float64)
            if own.shape != rewards.shape:
                raise GymError(f"reward must return the shape {rewards.shape}, not {own.shape}")
            rewards = np.where(self.flying, own, 0.0)
        self.flying &= ~(terminated | truncated)
        return rewards, terminated, truncated

    def _advance(self, actions: Array) -> None:
        if self._pool is None:
            self._advance_rows(actions, self._parts[0])
        else:  # each row depends on itself alone
            list(self._pool.map(partial(self._advance_rows, actions), self._parts))

    def _advance_rows(self, actions: Array, rows: slice) -> None:
        kernels.advance(
            self.x[rows],
            actions[rows],
            self._last[rows],
            self._older[rows],
            self.steps[rows],
            self._passed[rows],
            self.flying[rows],
            self._parameters[rows],
            self._mixers[rows],
            self._scales[rows],
            self.reference,
            self._stride,
            self.action == "rates",
            self.interval_s,
            self._substeps,
            self._limit_m,
            self._floor_m,
            self.gate_m,
            self.observations[rows],
            self._rewards[rows],
            self._ends[rows],
        )

    def info(self) -> dict[str, Any]:
        return {"why": ENDS[self._ends[0]]} if self._ends[0] else {}

    def why(self, n: int) -> str:
        return ENDS[self._ends[n]]

    def snapshot(self) -> EpisodesSnapshot:
        chances = tuple(None if it is None else it.bit_generator.state for it in self._chances)
        return EpisodesSnapshot(tuple(array.copy() for array in self._memory()), chances)

    def restore(self, snapshot: EpisodesSnapshot, chances: Sequence[Generator]) -> None:
        """Continue from a snapshot of the same keywords, with `chances` set to its random numbers."""
        memory = self._memory()
        kept = snapshot.arrays if isinstance(snapshot, EpisodesSnapshot) else ()
        if [(it.shape, it.dtype) for it in kept] != [(it.shape, it.dtype) for it in memory]:
            raise GymError("snapshot must come from snapshot() of an environment of the same size and keywords")
        for n, state in enumerate(snapshot.chances):
            if state is not None:
                chances[n].bit_generator.state = state
            self._chances[n] = None if state is None else chances[n]
        for array, value in zip(memory, kept, strict=True):
            array[:] = value

    def _memory(self) -> tuple[Any, ...]:
        return (
            *(self.x, self._last, self._older, self.steps, self._passed, self._parameters, self._mixers, self._scales),
            *(self._ends, self._rewards, self.observations, self.flying),
        )

    def _sampled(self, given: Any, duration_s: float) -> Array:
        """Return position and velocity at each interval of an episode and its preview, (m, 6), ENU."""
        named = given if isinstance(given, str | Trajectory) else sampled_track(given, duration_s)
        track = load_track(named, self.vehicle, load_profile("flight"))
        times_s = np.arange(self.length + 2 + self.preview * self._stride, dtype=np.float64) * self.interval_s
        return np.ascontiguousarray(np.hstack([position(track.track, times_s, order) for order in (0, 1)]))

    def _drawn(self, values: Mapping[str, Any]) -> Begun:
        wind, lost = Wind(0.0, 0.0), -1
        start: dict[str, float] = {}
        changes: list[tuple[str, Any]] = []
        for key, value in values.items():
            if key == "wind":
                wind = wind_of(value)
            elif key == "lost":
                lost = value
            elif key.startswith("vehicle."):
                changes.append((key.removeprefix("vehicle."), value))
            else:
                start[key.removeprefix("start.")] = value
        for place, key in enumerate(_COORDINATES):
            start[key] = start.get(key, 0.0) + float(self._first[place])
        vehicle, hover_rpm, whole, scale, mixer = self._built(changes)
        start.setdefault("rotors", hover_rpm)
        world = starting_world(Start(**start), vehicle)
        parameters = whole.copy()
        parameters["wind_enu_m_s"] = wind.velocity_enu_m_s
        if not isinstance(lost, int) or not -1 <= lost < vehicle.rotors.count:
            most = vehicle.rotors.count - 1
            raise GymError(f'draw: lost must be a rotor, 0 to {most}, or -1, not "{shown(lost)}"')
        if lost >= 0:
            for name in ("thrust", "yaw_moment", "power"):
                parameters[name][0, lost] = 0.0
        x = np.array((*world.state, *world.rotor_speeds, 0.0))
        action = level_action(world.rotor_speeds, vehicle, rates=self.action == "rates")
        return Begun(vehicle, wind, lost, x, action, parameters, mixer, scale)

    def _built(self, changes: list[tuple[str, Any]]) -> tuple[Any, ...]:
        if self._last_built is None or self._last_built[0] != changes:
            vehicle = self.vehicle
            for key, value in changes:
                vehicle = vehicle.replace(key, value)
            parameters = packed(parameters_of(vehicle, CALM))
            built = (vehicle, vehicle.hover_rpm, parameters, *scale_of(vehicle, self.max_rates))
            self._last_built = changes, built
        return self._last_built[1]
