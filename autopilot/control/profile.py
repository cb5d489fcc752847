"""A profile: which control law flies, with which numbers, and how its flights begin; read strictly from TOML."""

from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import msgspec

from colibri.autopilot.control.settings import ControlInterval
from colibri.autopilot.errors import AutopilotError
from colibri.common.config import Table, read_named

_FOLDER = Path(__file__).parents[1] / "profiles"

References: TypeAlias = Literal["by-formula", "by-differences"]


class ProfileError(AutopilotError):
    """A profile that cannot be flown; the message names file and key."""


class SimulationSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a flight with this profile begins."""

    vehicle: str
    integrator: Literal["rk4", "adaptive"]
    position_enu_m: tuple[float, float, float]
    rotor_speed_rpm: Annotated[float, msgspec.Meta(ge=0.0)]
    """Of every rotor, in turns per minute."""
    frame_interval_s: ControlInterval | None = None
    """Between two frames of the plant at most: they divide the control interval. Without it, that interval."""


class Profile(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A profile."""

    name: str
    controller: str
    """The control law that flies, by the name it is registered under."""
    references: References
    """Velocity and yaw from the track's formula, or by backward differences as in the thesis."""
    controllers: dict[str, dict[str, Any]]
    """The numbers of each control law that the profile knows; each law reads its own table strictly."""
    simulation: SimulationSettings

    def table(self, controller: str) -> dict[str, Any]:
        """Return the numbers of a control law; none for one that the profile does not know."""
        return self.controllers.get(controller, {})

    def with_choices(self, controller: str | None, solver: str | None) -> "Profile":
        """Return the profile with another control law, and another QP solver in the table of the one that flies.

        Raises:
            ProfileError: The control law has no QP to solve.
        """
        chosen = msgspec.structs.replace(self, controller=controller or self.controller)
        if solver is None:
            return chosen
        table = chosen.table(chosen.controller)
        if "qp" not in table:
            raise ProfileError(f"controller {chosen.controller} solves no QP: leave --solver out")
        with_solver = {**table, "qp": {**table["qp"], "solver": solver}}
        return msgspec.structs.replace(chosen, controllers={**chosen.controllers, chosen.controller: with_solver})


def load_profile(name_or_path: str) -> Profile:
    """Read a profile by its name, or from a file if the argument ends in `.toml`.

    Raises:
        ProfileError: There is no such profile, or the file has a missing, unknown or impossible key.
    """
    return read_named("profile", _FOLDER, name_or_path, Profile, ProfileError)
