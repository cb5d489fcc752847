"""A rate loop, for control laws that decide body rates and a thrust."""

from collections.abc import Sequence

import numpy as np

from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.control.parts.recovery import mix_with_priority
from colibri.autopilot.control.vehicle_model.mixer import mixing_of
from colibri.autopilot.errors import AutopilotError
from colibri.common.elementary import square
from colibri.common.errors import checked
from colibri.common.matrices import matvec
from colibri.common.types import Array, Vector
from colibri.plant.vehicle.description import Vehicle

_INTEGRAL = 0.1  # zero of the integral part, in parts of the inverse of the loop's delay
_MOST_INTEGRAL = 0.3  # of the largest moment about each axis


class RateLoop:
    """Rotor speeds for body rates and a thrust: a PI law on the angular acceleration, with ω × J ω fed forward.

    The gain is that of a damping of 0.7 behind the rotors' lag and half a control interval. Saturated rotors give up
    yaw first, then thrust.
    """

    def __init__(self, vehicle: Vehicle, interval_s: float) -> None:
        checked("vehicle", vehicle, Vehicle, "a Vehicle", AutopilotError)
        lag, rotors = vehicle.rotors.lag, vehicle.rotors
        delay_s = 0.5 * interval_s + (max(lag.time_constant_up_s, lag.time_constant_down_s) if lag else 0.0)
        self._inertia = vehicle.body.inertia()
        self._gain_1_s, self._interval_s = 0.5 / delay_s, interval_s
        self._step = _INTEGRAL * self._gain_1_s / delay_s * interval_s
        self._limit = _MOST_INTEGRAL * vehicle.max_wrench()[1:] / np.diag(self._inertia)
        self._mixing = mixing_of(vehicle.allocation() * square(rotors.max_speed))
        self._max_speed, self._least = rotors.max_speed, square(rotors.idle_speed / rotors.max_speed)

    def initial(self) -> Vector:
        """Return the memory of the first step: an angular acceleration, rad/s²."""
        return (0.0, 0.0, 0.0)

    def step(
        self, memory: Vector, state: VehicleState, rates: Sequence[float] | Array, thrust_n: float
    ) -> tuple[Vector, Array]:
        """Return the new memory, and rotor speeds (N,) in the vehicle's unit.

        Args:
            rates: p, q, r, rad/s, FLU.
            thrust_n: Along the body's z axis, N.
        """
        rate = np.array(state.rate_flu_rad_s)
        error = np.array(rates, dtype=np.float64) - rate
        integral = np.clip(np.array(memory) + self._step * error, -self._limit, self._limit)
        moment = matvec(self._inertia, self._gain_1_s * error + integral) + np.cross(rate, matvec(self._inertia, rate))
        squared = mix_with_priority(float(thrust_n), moment, self._mixing, self._least, 1.0)
        x, y, z = integral.tolist()
        return (x, y, z), self._max_speed * np.sqrt(squared)
