"""Flights as learning environments: `import colibri.gym` registers Hover, Track, Recover and Race."""

from colibri.gym.arguments import GymError, GymImportError

try:
    import gymnasium
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    raise GymImportError("colibri.gym needs gymnasium: pip install 'colibri-sitl[gym]'") from None

from colibri.gym.environment import QuadrotorEnv, QuadrotorVectorEnv
from colibri.gym.episodes import EpisodesSnapshot, GymTransition
from colibri.gym.export import export_policy

__all__ = [
    "EpisodesSnapshot",
    "GymError",
    "GymImportError",
    "GymTransition",
    "QuadrotorEnv",
    "QuadrotorVectorEnv",
    "export_policy",
]

_RACE = ((0, 0, 2), (4, 0, 2), (8, 4, 3), (4, 8, 2.5), (-4, 8, 2), (-8, 4, 3), (-4, 0, 2.5), (0, 0, 2))
_ENVIRONMENTS: dict[str, dict[str, object]] = {
    "colibri/Hover-v0": {"track": "hover"},
    "colibri/Track-v0": {"track": "lemniscate"},
    "colibri/Recover-v0": {"track": "hover:height=15", "start": "thrown", "limit_m": 20.0},
    "colibri/Race-v0": {"gates": _RACE, "preview": 1, "duration": 30.0},
}

for _name, _options in _ENVIRONMENTS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(
            _name,
            entry_point="colibri.gym.environment:QuadrotorEnv",
            vector_entry_point="colibri.gym.environment:vector_env",
            kwargs=_options,
        )
