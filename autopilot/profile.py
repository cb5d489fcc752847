"""A control profile: rates, weights, horizon, solver, poles, read strictly from a TOML file."""

from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec

from plant.vehicle import Positive, read_toml

Negative: TypeAlias = Annotated[float, msgspec.Meta(lt=0.0)]
Count: TypeAlias = Annotated[int, msgspec.Meta(ge=1, le=1000)]
PerAxis: TypeAlias = tuple[Positive, Positive, Positive]
Discretisation: TypeAlias = Literal["zero-order-hold", "forward-euler"]


class ProfileError(Exception):
    """A profile that cannot be flown; the message names file and key."""


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a profile: every number in it is finite."""

    def __post_init__(self) -> None:
        for key in self.__struct_fields__:
            value = getattr(self, key)
            numbers = value if isinstance(value, tuple) else (value,)
            if any(isinstance(number, float) and not isfinite(number) for number in numbers):
                raise ValueError(f"{key}: must be finite")


class PositionSettings(_Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The outer loop."""

    samples: Count
    """Control samples in one outer sample."""
    poles: tuple[Negative, Negative]
    """Closed-loop poles of each axis, rad/s."""


class AttitudeSettings(_Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The inner loop: the LPV-MPC."""

    horizon: Count
    shrinking_horizon: bool
    discretisation: Discretisation
    output_weight: PerAxis
    terminal_weight: PerAxis
    increment_weight: PerAxis


class QpSettings(_Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The QP solver, by its name in qpsolvers."""

    solver: str
    tolerance: Positive


class SimulationSettings(_Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a flight with this profile begins."""

    vehicle: str
    integrator: Literal["rk4", "adaptive"]
    position_enu_m: tuple[float, float, float]
    rotor_speed_rpm: Annotated[float, msgspec.Meta(ge=0.0)]
    """Of every rotor, in turns per minute."""


class Profile(_Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A control profile."""

    name: str
    control_interval_s: Annotated[float, msgspec.Meta(ge=0.001, le=1.0)]
    position: PositionSettings
    attitude: AttitudeSettings
    qp: QpSettings
    simulation: SimulationSettings

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        if not (self.control_interval_s * 1000.0).is_integer():
            raise ValueError("control_interval_s: must be whole milliseconds, as MAVLink counts them")
        if self.attitude.shrinking_horizon and self.attitude.horizon < self.position.samples:
            raise ValueError("attitude.horizon: a shrinking horizon must not end before the outer sample does")

    @property
    def control_interval_us(self) -> int:
        """The control interval in whole microseconds."""
        return round(self.control_interval_s * 1e6)


def profile_names() -> list[str]:
    """Return the names of the profiles that come with Colibri."""
    return sorted(entry.name.removesuffix(".toml") for entry in files("autopilot").joinpath("profiles").iterdir())


def load_profile(name_or_path: str) -> Profile:
    """Read a profile by its name, or from a file if the argument ends in `.toml`.

    Raises:
        ProfileError: There is no such profile, or the file has a missing, unknown or impossible key.
    """
    if name_or_path.endswith(".toml"):
        return read_toml(Path(name_or_path), Profile, ProfileError)
    if name_or_path not in profile_names():
        raise ProfileError(f"unknown profile {name_or_path}: choose {', '.join(profile_names())} or a .toml file")
    return read_toml(Path(str(files("autopilot").joinpath("profiles", f"{name_or_path}.toml"))), Profile, ProfileError)
