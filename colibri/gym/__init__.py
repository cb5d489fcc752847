"""Flights as learning environments: `import colibri.gym` registers `colibri/Hover-v0` and `colibri/Track-v0`."""

from colibri.gym.errors import GymError, GymImportError

try:
    import gymnasium
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    raise GymImportError("colibri.gym needs gymnasium: pip install 'colibri-sitl[gym]'") from None

from colibri.gym.environment import QuadrotorEnv, QuadrotorVectorEnv
from colibri.gym.episodes import EpisodesSnapshot, GymTransition

__all__ = ["EpisodesSnapshot", "GymError", "GymImportError", "GymTransition", "QuadrotorEnv", "QuadrotorVectorEnv"]

for _name, _track in {"colibri/Hover-v0": "hover", "colibri/Track-v0": "lemniscate"}.items():
    if _name not in gymnasium.registry:
        gymnasium.register(
            _name,
            entry_point="colibri.gym.environment:QuadrotorEnv",
            vector_entry_point="colibri.gym.environment:vector_env",
            kwargs={"track": _track},
        )
