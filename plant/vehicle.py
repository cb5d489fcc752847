"""The airframe: numbers with units and source, read strictly from a TOML file."""

from math import isfinite, pi, sqrt
from pathlib import Path
from typing import Annotated, Literal, TypeAlias, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

Positive: TypeAlias = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0)]
Part: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Array: TypeAlias = NDArray[np.float64]
T = TypeVar("T")

_FOLDER = Path(__file__).parent / "vehicles"
_RAD_S_PER_UNIT = {"rad/s": 1.0, "rpm": 2.0 * pi / 60.0}


class VehicleError(Exception):
    """A vehicle file that cannot be flown; the message names file and key."""


class Body(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The rigid body."""

    mass_kg: Positive
    inertia_kg_m2: tuple[Positive, Positive, Positive]
    """Ix, Iy, Iz about the FLU axes."""

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        _check_finite(self.mass_kg, *self.inertia_kg_m2)
        ix, iy, iz = sorted(self.inertia_kg_m2)
        if ix + iy < iz:
            raise ValueError("inertia_kg_m2: no body has one moment of inertia above the sum of the other two")


class RotorLag(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A rotor's speed follows its command as a first-order lag."""

    time_constant_up_s: Positive
    """While it speeds up."""
    time_constant_down_s: Positive
    """While it slows down."""

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        _check_finite(self.time_constant_up_s, self.time_constant_down_s)


class Rotors(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The four rotors, all alike. Speeds and coefficients are in the file's own `speed_unit`."""

    speed_unit: Literal["rad/s", "rpm"]
    thrust_coefficient: Positive
    """cT: thrust in N per speed unit squared."""
    torque_coefficient: Positive
    """cQ: drag torque in N m per speed unit squared."""
    inertia_kg_m2: Positive
    """J: moment of inertia of one rotor with its motor about its axis."""
    max_speed: Positive
    position_m: tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]
    """x forward, y left of each rotor."""
    direction: tuple[Literal["ccw", "cw"], Literal["ccw", "cw"], Literal["ccw", "cw"], Literal["ccw", "cw"]]
    """Seen from above."""
    gyroscopic_term: Literal["conserving", "as-printed"]
    """`conserving` keeps angular momentum; `as-printed` has the thesis's sign, and takes the speed in its own unit."""
    idle_speed: NotNegative = 0.0
    """What an armed rotor never falls below."""
    strength: tuple[Part, Part, Part, Part] = (1.0, 1.0, 1.0, 1.0)
    """Part of its thrust and torque that each rotor has: 0.85 is a rotor 15 % weak."""
    lag: RotorLag | None = None
    """Without it, rotors follow their commands at once."""

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        numbers = (self.thrust_coefficient, self.torque_coefficient, self.inertia_kg_m2, self.max_speed)
        _check_finite(*numbers, *(metre for position in self.position_m for metre in position))
        if self.idle_speed >= self.max_speed:
            raise ValueError("idle_speed: must lie below max_speed")
        if np.linalg.matrix_rank(_allocation(self)) < len(self.position_m):
            raise ValueError("position_m, direction: these rotors cannot turn the vehicle about every axis")


class Drag(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Forces against the motion through the air."""

    linear_n_s_m: tuple[NotNegative, NotNegative, NotNegative]
    """Of the airframe, along the FLU axes: N for each m/s."""
    rotor_coefficient: NotNegative
    """Of one rotor, in its plane: N for each m/s and for each of its speed unit."""

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        _check_finite(*self.linear_n_s_m, self.rotor_coefficient)


class Vehicle(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A quadrotor, described in SI but for its rotor speeds (`rotors.speed_unit`).

    What is None is not modelled.
    """

    name: str
    gravity_m_s2: Positive
    body: Body
    rotors: Rotors
    drag: Drag | None = None

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        _check_finite(self.gravity_m_s2)
        if self.hover_speed >= self.rotors.max_speed:
            raise ValueError(f"rotors.max_speed: hover needs {self.hover_speed:.0f} {self.rotors.speed_unit}")

    @property
    def hover_speed(self) -> float:
        """Rotor speed at which four rotors carry the weight."""
        weight_n = self.body.mass_kg * self.gravity_m_s2
        return sqrt(weight_n / (len(self.rotors.position_m) * self.rotors.thrust_coefficient))

    def speed_from_rpm(self, rpm: float) -> float:
        """Convert a rotor speed from turns per minute to the vehicle's unit."""
        return rpm * _RAD_S_PER_UNIT["rpm"] / _RAD_S_PER_UNIT[self.rotors.speed_unit]

    def allocation(self) -> Array:
        """Return the 4 x 4 matrix that maps squared rotor speeds to (U1 N, U2, U3, U4 N m), THESIS [2.2]."""
        return _allocation(self.rotors)

    def largest_wrench(self) -> Array:
        """Return the largest U1 (N), U2, U3, U4 (N m) that the rotors can make, each on its own, (4,)."""
        largest: Array = np.clip(self.allocation(), 0.0, None).sum(axis=1) * self.rotors.max_speed**2
        return largest

    def rotor_momentum(self) -> Array:
        """Return the row (4,) that maps rotor speeds to their angular momentum along body z, N m s.

        `conserving`: h = J (Ω1 - Ω2 + Ω3 - Ω4) with Ω in rad/s. `as-printed`: the thesis's +J Ω [2.8], opposite in
        sign, and Ω in the file's unit.
        """
        spin = _spin(self.rotors) * self.rotors.inertia_kg_m2
        if self.rotors.gyroscopic_term == "as-printed":
            return -spin
        return spin * _RAD_S_PER_UNIT[self.rotors.speed_unit]


def vehicle_names() -> list[str]:
    """Return the names of the vehicles that come with Colibri."""
    return toml_names(_FOLDER)


def load_vehicle(name_or_path: str) -> Vehicle:
    """Read a vehicle by its name, or from a file if the argument ends in `.toml`.

    Raises:
        VehicleError: There is no such vehicle, or the file has a missing, unknown or impossible key.
    """
    return read_named("vehicle", _FOLDER, name_or_path, Vehicle, VehicleError)


def toml_names(folder: Path) -> list[str]:
    """Return the names of the TOML files in a folder, without suffix."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def read_named(what: str, folder: Path, name_or_path: str, kind: type[T], error: type[Exception]) -> T:
    """Read the TOML file of that name in `folder`, or any file if the argument ends in `.toml`.

    Raises:
        error: There is no such name, or the file has a missing, unknown or impossible key.
    """
    if name_or_path.endswith(".toml"):
        return read_toml(Path(name_or_path), kind, error)
    known = toml_names(folder)
    if name_or_path not in known:
        raise error(f"unknown {what} {name_or_path}: choose {', '.join(known)} or a .toml file")
    return read_toml(folder / f"{name_or_path}.toml", kind, error)


def read_toml(path: Path, kind: type[T], error: type[Exception]) -> T:
    """Read a TOML file into a strict structure.

    Raises:
        error: The file cannot be read, or has a missing, unknown or impossible key; names file and key.
    """
    try:
        return msgspec.toml.decode(path.read_bytes(), type=kind)
    except OSError as reason:
        raise error(f"{path}: {reason.strerror}") from reason
    except msgspec.ValidationError as reason:
        what, _, where = str(reason).partition(" - at `$.")
        key = where.rstrip("`")
        raise error(f"{path}: {key}: {what}" if key else f"{path}: {what}") from reason
    except (msgspec.DecodeError, UnicodeDecodeError, ValueError) as reason:
        raise error(f"{path}: {reason}") from reason


def _allocation(rotors: Rotors) -> Array:
    x, y = np.array(rotors.position_m).T
    strength = np.array(rotors.strength)
    thrust = rotors.thrust_coefficient * strength
    return np.array([thrust, thrust * y, -thrust * x, -_spin(rotors) * rotors.torque_coefficient * strength])


def _spin(rotors: Rotors) -> Array:
    """Return +1 for a rotor that turns counter-clockwise seen from above, -1 for the others."""
    return np.array([1.0 if direction == "ccw" else -1.0 for direction in rotors.direction])


def _check_finite(*numbers: float) -> None:
    if not all(map(isfinite, numbers)):
        raise ValueError("every number must be finite")
