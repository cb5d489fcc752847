"""The airframe: numbers with units and source, read strictly from a TOML file."""

from collections.abc import Callable, Iterable
from math import inf, pi, sqrt
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import msgspec
import numpy as np

from colibri.common.config import NotNegative, Positive, Table, named_text, read_named, replaced, toml_names
from colibri.common.elementary import square
from colibri.common.types import Array, PerRotor, Vector
from colibri.plant.errors import PlantError
from colibri.plant.vehicle.rotor_numbering import FRAMES, Numbering, numbering
from colibri.plant.vehicle.sensors import Sensors as Sensors

Part: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Efficiency: TypeAlias = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
TimeConstant: TypeAlias = Annotated[float, msgspec.Meta(ge=0.001)]
"""At least the plant's integration step."""
PointInPlane: TypeAlias = tuple[float, float]
Point: TypeAlias = Annotated[tuple[float, ...], msgspec.Meta(min_length=2, max_length=3)]
Direction: TypeAlias = Literal["ccw", "cw"]

MIN_ROTORS, MAX_ROTORS = 3, 8
_ROUNDING = 1e-9
_Rotor = TypeVar("_Rotor")
_EachRotor: TypeAlias = Annotated[tuple[_Rotor, ...], msgspec.Meta(min_length=MIN_ROTORS, max_length=MAX_ROTORS)]

_FOLDER = Path(__file__).parent / "models"
AXES = ("thrust", "roll", "pitch", "yaw")
_RAD_S_PER_UNIT = {"rad/s": 1.0, "rpm": 2.0 * pi / 60.0}


class VehicleError(PlantError):
    """A vehicle file that cannot be flown; the message names file and key."""


class Body(Table, frozen=True, kw_only=True):
    """The rigid body."""

    mass_kg: Positive
    inertia_kg_m2: tuple[Positive, Positive, Positive]
    """Ix, Iy, Iz about the FLU axes through the centre of mass."""
    inertia_products_kg_m2: Vector = (0.0, 0.0, 0.0)
    """Ixy, Ixz, Iyz: the elements of the inertia matrix off its diagonal, Ixy = -∫ x y dm."""
    center_of_mass_m: Vector = (0.0, 0.0, 0.0)
    """x forward, y left, z up, in the frame of the positions of rotors and feet."""

    def __post_init__(self) -> None:
        super().__post_init__()
        largest = max(self.inertia_kg_m2)
        excess = 2.0 * largest - sum(self.inertia_kg_m2)
        if excess > _ROUNDING * largest:
            signs = [-1.0 if moment == largest else 1.0 for moment in self.inertia_kg_m2]
            near = [moment + sign * excess / 3.0 for moment, sign in zip(self.inertia_kg_m2, signs, strict=True)]
            near = [moment * (1.0 if sign < 0.0 else 1.001) for moment, sign in zip(near, signs, strict=True)]
            valid, rest = ", ".join(f"{moment:.4g}" for moment in near), sum(self.inertia_kg_m2) - largest
            raise ValueError(
                f"inertia_kg_m2: {largest:.4g} exceeds {rest:.4g}, the sum of the other two (nearest valid: [{valid}])"
            )
        if any(self.inertia_products_kg_m2):
            x, y, z = np.linalg.eigvalsh(self.inertia()).tolist()
            if x <= 0.0 or x + y < (1.0 - _ROUNDING) * z:
                moments = f"{x:.4g}, {y:.4g}, {z:.4g}"
                raise ValueError(
                    f"inertia_products_kg_m2: too large, with principal moments {moments}: "
                    "each must be above 0, and at most the sum of the other two"
                )

    def inertia(self) -> Array:
        """Return the inertia matrix about the centre of mass, kg m², FLU, (3, 3)."""
        xy, xz, yz = self.inertia_products_kg_m2
        x, y, z = self.inertia_kg_m2
        return np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])


class RotorLag(Table, frozen=True, kw_only=True):
    """A rotor's speed follows its command as a first-order lag."""

    time_constant_up_s: TimeConstant
    time_constant_down_s: TimeConstant


class Rotors(Table, frozen=True, kw_only=True):
    """The rotors, 3 to 8, all alike. Speeds and coefficients are in the file's own `speed_unit`."""

    speed_unit: Literal["rad/s", "rpm"]
    thrust_coefficient: Positive
    """cT: thrust in N per speed unit squared."""
    torque_coefficient: Positive
    """cQ: drag torque in N m per speed unit squared."""
    inertia_kg_m2: Positive
    """J: moment of inertia of one rotor with its motor about its axis."""
    max_speed: Positive
    position_m: _EachRotor[Point]
    """Position of each rotor: x forward, y left, and optionally z up."""
    direction: _EachRotor[Direction]
    """Direction of rotation of each rotor, seen from above, against the thrust."""
    gyroscopic_term: Literal["conserving", "as-printed"]
    """`conserving` conserves angular momentum; `as-printed` has the thesis's sign and speed unit."""
    idle_speed: NotNegative = 0.0
    """Minimum speed of an armed rotor."""
    axis: tuple[Vector, ...] = ()
    """Direction of each rotor's thrust, FLU, of any length. Without it, all rotors thrust upwards."""
    strength: tuple[Part, ...] = ()
    """Factor on thrust and torque of each rotor: 0.85 is a rotor 15 % weak. Without it, all are 1."""
    control: Literal["speed", "thrust"] = "speed"
    """Quantity that a control of 0 to 1 scales, in interfaces of other simulators and autopilots."""
    lag: RotorLag | None = None
    """Without it, rotors follow their commands at once."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.idle_speed >= self.max_speed:
            raise ValueError("idle_speed: must lie below max_speed")
        if not self.strength:
            msgspec.structs.force_setattr(self, "strength", (1.0,) * self.count)
        of_each = {"direction": self.direction, "axis": self.axis or self.stopped, "strength": self.strength}
        for key, given in of_each.items():
            if len(given) != self.count:
                raise ValueError(f"{key}: {len(given)} given for the {self.count} rotors of position_m")
        if not all(map(any, self.axis)):
            raise ValueError("axis: a direction needs a length above 0")

    @property
    def count(self) -> int:
        return len(self.position_m)

    def axes(self) -> Array:
        """Return the unit vectors of the thrusts, FLU, (N, 3)."""
        axes = np.array(self.axis or ((0.0, 0.0, 1.0),) * self.count)
        unit: Array = axes / np.sqrt((axes * axes).sum(axis=1))[:, None]
        return unit

    @property
    def stopped(self) -> PerRotor:
        """The command of rotors that stand."""
        return (0.0,) * self.count

    def points_m(self) -> Array:
        """Return the positions with their heights, (N, 3)."""
        return np.array([(*point, 0.0)[:3] for point in self.position_m])

    def spin(self) -> Array:
        """Return 1 for each rotor that turns counter-clockwise, else -1, (N,)."""
        return np.array([1.0 if direction == "ccw" else -1.0 for direction in self.direction])

    def speeds_of(self, controls: PerRotor) -> PerRotor:
        """Return rotor speeds, in parts of the top speed, for another autopilot's controls."""
        return controls if self.control == "speed" else tuple(map(sqrt, controls))

    def controls_of(self, speeds: PerRotor) -> PerRotor:
        return speeds if self.control == "speed" else tuple(speed * speed for speed in speeds)

    def numbering(self) -> Numbering:
        found = numbering(self.position_m, self.direction)
        if found is None:
            known = ", ".join(FRAMES)
            raise VehicleError(f"rotors: places and directions are not those of a frame of ArduPilot ({known})")
        return found

    def px4_numbering(self) -> Numbering:
        """Return PX4's numbering of this frame, or the vehicle file's for a frame that PX4 has no numbers for."""
        return numbering(self.position_m, self.direction) or Numbering("", reverse=False, rotors=(*range(self.count),))


class Drag(Table, frozen=True, kw_only=True):
    """Forces against the motion through the air."""

    linear_n_s_m: tuple[NotNegative, NotNegative, NotNegative]
    """Linear drag of the airframe along the FLU axes, N per m/s."""
    rotor_coefficient: NotNegative
    """Drag of one rotor in its plane, N per m/s and per speed unit."""
    quadratic_n_s2_m2: tuple[NotNegative, NotNegative, NotNegative] = (0.0, 0.0, 0.0)
    """Quadratic drag of the airframe along the FLU axes: N per m/s along the axis and per m/s of airspeed. Only the
    plant models it; control laws estimate it as a disturbance."""
    learned: bool = False
    """Whether linear drag and rotor drag are only estimates: the law `lpv-mpc` then learns them in flight."""


class Ground(Table, frozen=True, kw_only=True):
    """Ground contact, of the feet, or of the rotors if the vehicle is upside down.

    Values apply per foot. Height 0 is the centre of mass of the vehicle at rest on its feet.
    """

    foot_position_m: _EachRotor[PointInPlane]
    """Position of each foot, 3 to 8: x forward, y left."""
    foot_depth_m: Positive
    """Distance of the feet below the centre of mass."""
    stiffness_n_m: Positive
    damping_n_s_m: NotNegative
    friction_coefficient: NotNegative
    slip_damping_n_s_m: NotNegative
    """Friction of one foot below Coulomb's limit, N per m/s."""


class Battery(Table, frozen=True, kw_only=True):
    """A battery: a voltage that falls linearly with the charge taken, behind a resistance.

    Voltages are without load. The rotors' top speed is proportional to the terminal voltage.
    """

    full_voltage_v: Positive
    empty_voltage_v: Positive
    resistance_ohm: NotNegative
    capacity_ah: Positive
    efficiency: Efficiency
    """Mechanical power of the rotors / electrical power."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.empty_voltage_v > self.full_voltage_v:
            raise ValueError("empty_voltage_v: must not lie above full_voltage_v")


class Vehicle(Table, frozen=True, kw_only=True):
    """A multirotor, in SI units except for rotor speeds. Parts that are `None` are not modelled."""

    name: str
    gravity_m_s2: Positive
    body: Body
    rotors: Rotors
    drag: Drag | None = None
    ground: Ground | None = None
    battery: Battery | None = None
    sensors: Sensors | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        axes, rotors = controlled_axes(self.allocation()), self.rotors
        free_yaw = rotors.count == MIN_ROTORS or not all(rotors.strength)
        if len(axes) < len(AXES) - free_yaw:
            only = f"only {', '.join(axes) or 'none'}"
            raise ValueError(f"rotors.position_m, direction, axis: the rotors cannot control every axis, {only}")
        if not self.hover_speed < self.rotors.max_speed:
            raise ValueError(f"rotors.max_speed: hover needs {self.hover_speed:.0f} {self.rotors.speed_unit}")

    def replace(self, key: str, value: Any) -> "Vehicle":
        """Return the vehicle with another value at a dotted key such as `body.mass_kg`; a star marks its name."""
        changed = replaced(self, key, value, VehicleError)
        return changed if key == "name" else msgspec.structs.replace(changed, name=f"{self.name.rstrip('*')}*")

    def without_rotor(self, rotor: int) -> "Vehicle":
        """Return the vehicle with a rotor, counted from 0, that has no thrust."""
        strength = tuple(0.0 if i == rotor else part for i, part in enumerate(self.rotors.strength))
        return self.replace("rotors.strength", strength)

    def without(self, parts: Iterable[str]) -> "Vehicle":
        """Return the vehicle without some of the parts `rotor-lag`, `drag`, `ground`, `battery`."""
        vehicle = self
        for part in parts:
            vehicle = msgspec.structs.replace(vehicle, **_WITHOUT[part](vehicle))
        return vehicle

    @property
    def hover_speed(self) -> float:
        """Rotor speed in hover."""
        weight_n, lift = self.body.mass_kg * self.gravity_m_s2, float(self.rotors.axes()[:, 2].sum())
        return sqrt(weight_n / (lift * self.rotors.thrust_coefficient)) if lift > 0.0 else inf

    @property
    def hover_rpm(self) -> float:
        """Rotor speed in hover, rpm."""
        return self.hover_speed / self.speed_from_rpm(1.0)

    @property
    def ground_height_m(self) -> float:
        """Height of the ground, z of ENU; at rest, feet slightly compressed, the vehicle is at 0."""
        if self.ground is None:
            return -inf
        load_n = self.body.mass_kg * self.gravity_m_s2 / len(self.ground.foot_position_m)
        return load_n / self.ground.stiffness_n_m - self.ground.foot_depth_m

    def speed_from_rpm(self, rpm: float) -> float:
        """Convert a rotor speed from turns per minute to the vehicle's unit."""
        return rpm * (_RAD_S_PER_UNIT["rpm"] / self.rad_s_per_speed_unit)

    @property
    def rad_s_per_speed_unit(self) -> float:
        """The vehicle's unit of rotor speed, in rad/s."""
        return _RAD_S_PER_UNIT[self.rotors.speed_unit]

    @property
    def is_flat(self) -> bool:
        """Whether all rotors thrust along z in the plane of the centre of mass, and the inertia matrix is diagonal."""
        flat = not self.arms_m()[:, 2].any() and (self.rotors.axes()[:, 2] == 1.0).all()
        return bool(flat) and not any(self.body.inertia_products_kg_m2)

    def arms_m(self) -> Array:
        """Return the positions of the rotors from the centre of mass, FLU, (N, 3)."""
        arms: Array = self.rotors.points_m() - np.array(self.body.center_of_mass_m)
        return arms

    def contacts_m(self) -> Array:
        """Return the points from the centre of mass, FLU, that can touch the ground, (n, 3): feet, then rotors."""
        assert self.ground is not None, "only what has a ground can touch it"
        x, y, _ = self.body.center_of_mass_m
        feet = [(foot_x - x, foot_y - y, -self.ground.foot_depth_m) for foot_x, foot_y in self.ground.foot_position_m]
        return np.array([*feet, *self.arms_m()])

    def wrenches(self) -> Array:
        """Return the matrix from squared rotor speeds to force, N, and moment, N m, FLU, (6, N)."""
        rotors, axes = self.rotors, self.rotors.axes().T
        strength = np.array(rotors.strength)
        force = rotors.thrust_coefficient * strength * axes
        drag = -rotors.spin() * rotors.torque_coefficient * strength * axes
        x, y, z = self.arms_m().T
        moment = np.array([y * force[2] - z * force[1], z * force[0] - x * force[2], x * force[1] - y * force[0]])
        return np.concatenate([force, moment + drag])

    def allocation(self) -> Array:
        """Return the matrix from squared rotor speeds to (U1 N, U2, U3, U4 N m), THESIS [2.2], (4, N).

        With products of inertia, moments are those that turn a body with the diagonal alone likewise: D I⁻¹ τ.
        """
        if any(self.body.inertia_products_kg_m2):
            from colibri.common.matrices import inverse, matmul  # loads Numba, which most vehicles do without

            wrenches, inertia = self.wrenches(), self.body.inertia()
            alike = np.diag(inertia)[:, None] * matmul(inverse(inertia), wrenches[3:])
            return np.concatenate([wrenches[2:3], alike])
        if not self.is_flat:
            return self.wrenches()[2:]
        rotors, (x, y, _) = self.rotors, self.arms_m().T
        strength = np.array(rotors.strength)
        thrust = rotors.thrust_coefficient * strength
        return np.array([thrust, thrust * y, -thrust * x, -rotors.spin() * rotors.torque_coefficient * strength])

    def max_wrench(self) -> Array:
        """Return the largest U1 (N), U2, U3, U4 (N m) of the rotors, each on its own, (4,)."""
        max_wrench: Array = np.clip(self.allocation(), 0.0, None).sum(axis=1) * square(self.rotors.max_speed)
        return max_wrench

    def momentum_along_z(self) -> Array:
        """Return the row (N,) that maps rotor speeds to their angular momentum along body z, N m s."""
        momentum: Array = self.rotor_momentum() * self.rotors.axes()[:, 2]
        return momentum

    def rotor_momentum(self) -> Array:
        """Return the row (N,) that maps rotor speeds to their angular momentum along their axes, N m s.

        `as-printed` is the thesis's +J Ω [2.8]: opposite in sign to J (Ω1 - Ω2 + Ω3 - Ω4), and Ω in the file's unit.
        """
        spin = self.rotors.spin() * self.rotors.inertia_kg_m2
        if self.rotors.gyroscopic_term == "as-printed":
            return -spin
        return spin * self.rad_s_per_speed_unit


def vehicle_names() -> list[str]:
    """Return the names of the vehicles that come with Colibri."""
    return toml_names(_FOLDER)


def vehicle_text(name: str) -> str:
    return named_text("vehicle", _FOLDER, name, VehicleError)


def load_vehicle(given: str | Vehicle) -> Vehicle:
    """Read a vehicle by its name, or from a file if the name ends in `.toml`; a `Vehicle` is returned as it is.

    Raises:
        VehicleError: The vehicle is unknown, or the file has a missing, unknown or impossible key.
    """
    return given if isinstance(given, Vehicle) else read_named("vehicle", _FOLDER, given, Vehicle, VehicleError)


def controlled_axes(allocation: Array) -> tuple[str, ...]:
    """Return the axes that rotors with an allocation, (4, N), control together: yaw is the first to be given up."""
    length = np.sqrt((allocation * allocation).sum(axis=1))
    unit = allocation / np.where(length > 0.0, length, 1.0)[:, None]
    for count in range(len(AXES), 0, -1):
        if np.linalg.matrix_rank(unit[:count]) == count:
            return AXES[:count]
    return ()


_WITHOUT: dict[str, Callable[[Vehicle], dict[str, Any]]] = {
    "rotor-lag": lambda vehicle: {"rotors": msgspec.structs.replace(vehicle.rotors, lag=None)},
    "drag": lambda _vehicle: {"drag": None},
    "ground": lambda _vehicle: {"ground": None},
    "battery": lambda _vehicle: {"battery": None},
}
