"""Profiles, read strictly from TOML: the control law, its settings and the start of a flight."""

from pathlib import Path, PurePath
from typing import Annotated, Any, Literal, TypeAlias

import msgspec

from colibri.autopilot.control.law_files import table_of
from colibri.autopilot.control.scaling import formulas, scaled
from colibri.autopilot.control.settings import ControlInterval, current_name
from colibri.autopilot.errors import AutopilotError
from colibri.common.config import SettingsError, Table, named_text, plain, read_named, replaced, toml_names, value_at
from colibri.plant.vehicle.description import Vehicle, load_vehicle

_FOLDER = Path(__file__).parents[1] / "profiles"

References: TypeAlias = Literal["by-formula", "by-differences"]


class ProfileError(AutopilotError):
    """An invalid profile; the message names file and key."""


class SimulationSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a flight with this profile begins."""

    vehicle: str
    integrator: Literal["rk4", "adaptive"]
    position_enu_m: tuple[float, float, float] | None = None
    """Without it, at the track's first point."""
    rotor_speed_rpm: Annotated[float, msgspec.Meta(ge=0.0)] | None = None
    """Initial speed of every rotor, rpm. Without it, the hover speed."""
    frame_interval_s: ControlInterval | None = None
    """Largest interval between plant frames, a divisor of the control interval; by default that, on sensors 0.02."""

    def rotor_speed(self, vehicle: Vehicle) -> float:
        """Return the rotor speed at the start, in the vehicle's unit."""
        return vehicle.hover_speed if self.rotor_speed_rpm is None else vehicle.speed_from_rpm(self.rotor_speed_rpm)


class ProfileTables(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The file of a profile."""

    name: str = ""
    controller: str
    """Registered name of the control law."""
    references: References
    """Derivatives of references: from the track's formula, or by backward differences as in the thesis."""
    delay_s: Annotated[float, msgspec.Meta(ge=0.0, le=0.2)] | None = None
    """Delay to compensate, from a frame until its command takes effect; None: as measured by the plant."""
    controllers: dict[str, dict[str, Any]]
    """Settings of each control law; unknown keys are refused."""
    simulation: SimulationSettings


class Profile(ProfileTables, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A profile, named by its `name` key or its path, never as a built-in one."""

    file: str = ""  # its path; empty for a built-in profile

    def __hash__(self) -> int:
        return hash((self.name, self.file))

    @property
    def where(self) -> str:
        """Name in error messages."""
        return self.file or f"profile {self.name}"

    def table(self, controller: str) -> dict[str, Any]:
        """Return the settings of a control law; empty for an unknown one."""
        return self.controllers.get(table_of(controller), {})

    def of(self, vehicle: Vehicle) -> "Profile":
        """Return the profile scaled to a vehicle.

        Raises:
            ProfileError: The vehicle is too heavy for its rotors, or a ratio is invalid.
        """
        name = self.controller
        try:
            table = scaled(name, self.table(name), vehicle)
        except SettingsError as error:
            raise ProfileError(f"{self.where}: controllers.{name}: {error}") from error
        if "scaling" not in self.table(name):
            return self
        return msgspec.structs.replace(self, controllers={**self.controllers, name: table})

    def value(self, key: str) -> Any:
        """Return the value at a dotted key, scaled by the profile's own vehicle if necessary."""
        return value_at(self._with(key), key, ProfileError)

    def _with(self, key: str) -> "Profile":
        """Return the profile with a number that follows from the vehicle; for an unknown key, with all of them."""
        law, _, number = key.partition(".")[2].partition(".")
        room, _, name = number.partition(".")
        table = self.table(law)
        if "scaling" not in table or number in table or name.partition(".")[0] in table.get(room, ()):
            return self
        found = scaled(law, table, load_vehicle(self.simulation.vehicle))
        known = [row for row in formulas(law) if number == row or number.startswith(f"{row}.")]
        for row in known or formulas(law):
            room, _, name = row.rpartition(".")
            one = {room: {**table[room], name: found[room][name]}} if room else {name: found[name]}
            table = {**table, **one}
        return msgspec.structs.replace(self, controllers={**self.controllers, law: table})

    def replace(self, key: str, value: Any) -> "Profile":
        """Return the profile with another value at a dotted key; a star marks its name.

        `controllers.NAME` may be new: the settings of your own control law.

        Raises:
            ProfileError: The key is unknown, or the value invalid.
        """
        above, _, law = str(key).partition(".")
        whole = above == "controllers" and law and "." not in law
        value = plain(value)
        changed = (
            replaced(self, above, {**self.controllers, law: value}, ProfileError)
            if whole
            else replaced(self._with(str(key)), key, value, ProfileError)
        )
        changed = msgspec.structs.replace(changed, name=f"{self.name.rstrip('*')}*", file="")
        _check_frames(changed)
        return changed

    def with_choices(self, controller: str | None, solver: str | None, delay_s: float | None = None) -> "Profile":
        """Return the profile with another control law, delay, and QP solver."""
        told_s = self.delay_s if delay_s is None else delay_s
        name = current_name(controller or self.controller)
        chosen = msgspec.structs.replace(self, controller=name, delay_s=told_s)
        if solver is None:
            return chosen
        table = chosen.table(chosen.controller)
        if "qp" not in table:
            raise ProfileError(f"controller {chosen.controller} solves no QP: leave --solver out")
        with_solver = {**table, "qp": {**table["qp"], "solver": solver}}
        return msgspec.structs.replace(
            chosen, controllers={**chosen.controllers, table_of(chosen.controller): with_solver}
        )


def load_profile(given: str | Profile) -> Profile:
    """Read a profile by its name, or from a file if the name ends in `.toml`.

    Raises:
        ProfileError: The profile is unknown, or the file has a missing, unknown or invalid key.
    """
    if isinstance(given, Profile):
        return given
    given = str(given) if isinstance(given, PurePath) else given
    tables = read_named("profile", _FOLDER, given, ProfileTables, ProfileError)
    values = {key: getattr(tables, key) for key in tables.__struct_fields__}
    values["controller"] = current_name(tables.controller)
    values["controllers"] = {current_name(name): table for name, table in tables.controllers.items()}
    if given.endswith(".toml"):
        path, taken = Path(given), {"", *profile_names()}
        name = next((name for name in (tables.name, path.stem) if name not in taken), path.name)
        values |= {"name": name, "file": given}
    profile = Profile(**values)
    _check_frames(profile)
    return profile


def profile_text(name: str) -> str:
    return named_text("profile", _FOLDER, name, ProfileError)


def profile_names() -> list[str]:
    return toml_names(_FOLDER)


def _check_frames(profile: Profile) -> None:
    frame_s = profile.simulation.frame_interval_s
    control_s = profile.table(profile.controller).get("control_interval_s")
    if frame_s is None or not isinstance(control_s, float) or not 0.0 < control_s <= 1.0:
        return
    frame_us, control_us = round(frame_s * 1e6), round(control_s * 1e6)
    if frame_us % 1000 or control_us % frame_us:
        fitting = [f"{ms / 1000:g}" for ms in range(1, control_us // 1000 + 1) if control_us % (1000 * ms) == 0]
        raise ProfileError(
            f"{profile.where}: simulation.frame_interval_s: {frame_s:g} does not divide the control interval of "
            f"{control_s:g} s: choose {', '.join(fitting)}"
        )
