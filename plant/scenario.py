"""The world that a flight begins in, as the command line says it: start, and parts left out of the model.

Nothing here needs what is compiled: who only plans a flight, or starts the plant, does not wait for it.
"""

from argparse import ArgumentTypeError
from math import radians
from typing import NamedTuple

import numpy as np

from mavlink.frames import Quaternion, Vector, earth_from_body, quaternion_from_euler, rotation_matrix
from mavlink.process import ArgumentParser, nudge_m, number
from plant.vehicle import Vehicle, VehicleError
from plant.weather import add_weather_arguments

PARTS = ("rotor-lag", "drag", "ground", "battery")
"""What `Vehicle.without` can leave out."""

LARGEST_LATENCY_MS = 1000.0
LATENCY_HELP = (
    "one way, simulated: the command that answers a frame acts twice that later, and the one before it is held until "
    "then (default 0)"
)

_DEEPEST_START_M = 0.01


class IntegrationError(Exception):
    """The state cannot be integrated any further."""


class Start(NamedTuple):
    """How the vehicle begins. Angles are Z-Y'-X''.

    Attributes:
        x: Position, ENU, m.
        y: Position, ENU, m.
        z: Position, ENU, m.
        phi: Roll, degrees.
        theta: Pitch, degrees.
        psi: Yaw, degrees.
        vx: Velocity, ENU, m/s.
        vy: Velocity, ENU, m/s.
        vz: Velocity, ENU, m/s.
        p: Body rate, FLU, rad/s.
        q: Body rate, FLU, rad/s.
        r: Body rate, FLU, rad/s.
        rotors: Speed of every rotor, turns per minute.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    phi: float = 0.0
    theta: float = 0.0
    psi: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    p: float = 0.0
    q: float = 0.0
    r: float = 0.0
    rotors: float = 0.0

    @property
    def attitude(self) -> Quaternion:
        """The unit quaternion that turns FLU into ENU."""
        return quaternion_from_euler(radians(self.phi), radians(self.theta), radians(self.psi))

    @property
    def velocity_flu_m_s(self) -> Vector:
        """The velocity in the body frame."""
        w, x, y, z = self.attitude
        return earth_from_body((w, -x, -y, -z), (self.vx, self.vy, self.vz))

    def __str__(self) -> str:
        """Return what `start_values` reads back."""
        return ",".join(f"{key}={value!r}" for key, value in self._asdict().items())


def nudged(start: Start) -> Start:
    """Return where a flight really begins: `nudge_m` east and north of its start, which is at it unless tests say."""
    return start._replace(x=start.x + nudge_m(), y=start.y + nudge_m())


def check_start(start: Start, vehicle: Vehicle) -> None:
    """Check that a vehicle can start like that.

    Raises:
        VehicleError: Its rotors do not turn so fast, or it would start in the ground.
    """
    if not 0.0 <= vehicle.speed_from_rpm(start.rotors) <= vehicle.rotors.max_speed:
        raise VehicleError(f"the rotors of {vehicle.name} cannot start at {start.rotors:g} rpm")
    if vehicle.ground is None:
        return
    _, _, up = rotation_matrix(start.attitude)
    lowest_m = start.z + float((vehicle.ground.contacts_m(vehicle.rotors) * np.array(up)).sum(axis=1).min())
    depth_m = vehicle.ground_height_m - lowest_m
    if depth_m > _DEEPEST_START_M:
        raise VehicleError(f"{vehicle.name} would start {depth_m:.3g} m below the ground: start it higher")


def start_values(text: str) -> dict[str, float]:
    """Read values of a start of the command line, `KEY=VALUE[,KEY=VALUE...]`."""
    return dict(_start_value(pair) for pair in text.split(","))


def _start_value(pair: str) -> tuple[str, float]:
    key, _, value = pair.partition("=")
    if key not in Start._fields:
        raise ArgumentTypeError(f"unknown key {key}: choose {', '.join(Start._fields)}")
    try:
        return key, number(value)
    except ValueError:
        raise ArgumentTypeError(f"{key}: must be a number, not {value}") from None


def latency(text: str) -> float:
    """Read a latency of the command line, ms: none is negative, and a second is more than anything could fly with."""
    value = number(text)
    if not 0.0 <= value <= LARGEST_LATENCY_MS:
        raise ArgumentTypeError(f"must be 0 to {LARGEST_LATENCY_MS:g} ms, not {text}")
    return value


def add_world_arguments(parser: ArgumentParser, *, start: str, of_whom: str = "") -> None:
    """Add `--wind`, `--gust`, `--turbulence`, `--without` and `--start`.

    Args:
        parser: To add them to.
        start: What is overridden by `--start`, for its help.
        of_whom: Whose model `--without` concerns, for its help.
    """
    add_weather_arguments(parser)
    add = parser.add_argument
    add(
        "--without",
        action="append",
        default=[],
        choices=PARTS,
        help=f"leave a part of the vehicle file out of the model{of_whom}; may be repeated",
    )
    add(
        "--start",
        type=start_values,
        default={},
        metavar="KEY=VALUE,...",
        help="begin otherwise: x, y, z (m, ENU), phi, theta, psi (degrees), vx, vy, vz (m/s, ENU), p, q, r (rad/s, "
        f"FLU), rotors (rpm) (default: {start})",
    )
