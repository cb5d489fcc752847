"""The LPV model of attitude as an object: A, B, C, D at one scheduling point, continuous or sampled, THESIS [3.3]."""

from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.thesis.lpv_model import ATTITUDE_OUTPUT, Discretisation, attitude_model, discretise
from colibri.common.matrices import dot
from colibri.common.types import Array, PerRotor
from colibri.plant.vehicle.description import Vehicle, load_vehicle

STATES = ("phi", "phi_rate", "theta", "theta_rate", "psi", "psi_rate")
INPUTS = ("U2", "U3", "U4")
OUTPUTS = ("phi", "theta", "psi")


class Point(NamedTuple):
    """A scheduling point; the default is hover.

    Attributes:
        phi_rate_rad_s, theta_rate_rad_s: Derivatives of the Euler angles.
        rotor_speeds: In the vehicle's unit and rotor order.
    """

    phi_rate_rad_s: float = 0.0
    theta_rate_rad_s: float = 0.0
    rotor_speeds: PerRotor = (0.0, 0.0, 0.0, 0.0)


HOVER = Point()


class LpvModel(NamedTuple):
    """A linear model: rad, rad/s and N m, in the order of `STATES`, `INPUTS` and `OUTPUTS`.

    Attributes:
        interval_s: Of a sampled model; `None` for a continuous one.
    """

    A: Array  # (6, 6)
    B: Array  # (6, 3)
    C: Array  # (3, 6)
    D: Array  # (3, 3), zero
    interval_s: float | None = None

    def sampled(self, interval_s: float, method: Discretisation = "zero-order-hold") -> "LpvModel":
        """Return the model of samples `interval_s` apart."""
        if self.interval_s is not None or not interval_s > 0.0:
            raise ValueError(f"interval_s must be above 0 s, of a continuous model, not {interval_s!r}")
        n = len(self.A)
        transition = discretise(self.A, self.B, interval_s, method)
        return LpvModel(transition[:n, :n], transition[:n, n:], self.C, self.D, interval_s)


def model(vehicle: Any, point: Point = HOVER) -> LpvModel:
    """Return the model of a vehicle, by its name, file or object, at a scheduling point."""
    flown: Vehicle = load_vehicle(vehicle)
    momentum = dot(flown.rotor_momentum(), np.array(point.rotor_speeds, dtype=np.float64))
    A, B = attitude_model(
        point.phi_rate_rad_s, point.theta_rate_rad_s, momentum, inertia_kg_m2=flown.body.inertia_kg_m2
    )
    return LpvModel(A, B, ATTITUDE_OUTPUT.copy(), np.zeros((3, 3)))
