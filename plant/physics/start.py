"""The start of a flight: position, attitude, velocity, rotors."""

from math import radians
from typing import NamedTuple

import numpy as np

from colibri.common.errors import InFlightError
from colibri.common.process.lifecycle import nudge_m
from colibri.common.rotations import earth_from_body, quaternion_from_euler, rotation_matrix
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.errors import PlantError
from colibri.plant.physics.contact import check_contact
from colibri.plant.vehicle.description import Vehicle, VehicleError

_MAX_START_DEPTH_M = 0.01


class IntegrationError(PlantError, InFlightError):
    """The state cannot be integrated any further."""


class Start(NamedTuple):
    """Initial state; position and velocity are ENU, angles Z-Y'-X'', rates FLU."""

    x: float = 0.0  # m
    y: float = 0.0
    z: float = 0.0
    phi: float = 0.0  # degrees
    theta: float = 0.0
    psi: float = 0.0
    vx: float = 0.0  # m/s
    vy: float = 0.0
    vz: float = 0.0
    p: float = 0.0  # rad/s
    q: float = 0.0
    r: float = 0.0
    rotors: float = 0.0  # rpm, of every rotor

    @property
    def attitude(self) -> Quaternion:
        return quaternion_from_euler(radians(self.phi), radians(self.theta), radians(self.psi))

    @property
    def velocity_flu_m_s(self) -> Vector:
        w, x, y, z = self.attitude
        return earth_from_body((w, -x, -y, -z), (self.vx, self.vy, self.vz))

    def __str__(self) -> str:
        return ",".join(f"{key}={value!r}" for key, value in self._asdict().items())


def check_start(start: Start, vehicle: Vehicle) -> None:
    """Raise a VehicleError if a vehicle cannot start there."""
    check_contact(vehicle)
    if not 0.0 <= vehicle.speed_from_rpm(start.rotors) <= vehicle.rotors.max_speed:
        raise VehicleError(f"the rotors of {vehicle.name} cannot start at {start.rotors:g} rpm")
    if vehicle.ground is None:
        return
    _, _, up = rotation_matrix(start.attitude)
    min_height_m = start.z + float((vehicle.contacts_m() * np.array(up)).sum(axis=1).min())
    depth_m = vehicle.ground_height_m - min_height_m
    if depth_m > _MAX_START_DEPTH_M:
        raise VehicleError(f"{vehicle.name} would start {depth_m:.3g} m below the ground: start it higher")


def default_starts(vehicle: Vehicle) -> dict[Feedback, Start]:
    """Return a hover near the thesis's spiral; on sensors the ground below, where the estimator initialises."""
    flying = Start(y=-1.0, z=2.0, psi=90.0, rotors=vehicle.hover_rpm)
    return {Feedback.STATE: flying, Feedback.SENSORS: Start(y=-1.0, psi=90.0)}


def nudged(start: Start) -> Start:
    return start._replace(x=start.x + nudge_m(), y=start.y + nudge_m())
