"""The predicted path of the control law's plan."""

from math import isnan

import numpy as np

from colibri.autopilot.control.interface import Diagnostics, Horizon, PlanColumns, VehicleState
from colibri.common.elementary import square
from colibri.common.jit import compiled
from colibri.common.kernels import cos, sin
from colibri.common.matrices import matvec
from colibri.common.types import Array
from colibri.mavlink.telemetry.snapshot import Forecast
from colibri.plant.vehicle.description import Vehicle

POINTS = 5  # size of TRAJECTORY_REPRESENTATION_WAYPOINTS


class Forecaster:
    def __init__(self, vehicle: Vehicle, interval_s: float, columns: PlanColumns | None) -> None:
        self._columns = columns
        self._full_thrust_n = vehicle.allocation()[0] * square(vehicle.rotors.max_speed)
        self._mass_kg = vehicle.body.mass_kg
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self._interval_s = interval_s
        if columns is not None:  # compiled before it flies
            plan = np.zeros((2, 1 + max(columns)))
            _motion(np.zeros(6), plan, columns, np.zeros(1), self._mass_kg, self._gravity_m_s2, interval_s)

    def forecast(self, state: VehicleState, references: Horizon | None, how: Diagnostics) -> tuple[Forecast, ...]:
        plan, squared = how.predicted, how.planned_squared
        if plan is not None and squared is not None and self._columns is not None:
            begin = np.array((*state.position_enu_m, *state.velocity_enu_m_s))
            mass_kg = self._mass_kg if isnan(how.mass_kg) else how.mass_kg
            thrusts_n = matvec(squared, self._full_thrust_n)
            motion = _motion(begin, plan, self._columns, thrusts_n, mass_kg, self._gravity_m_s2, self._interval_s)
            psi, yaw_rate = plan[1:, self._columns.psi], plan[1:, self._columns.yaw_rate]
            return self._points(motion[:, 0:3], motion[:, 3:6], motion[:, 6:9], psi, yaw_rate)
        if references is None or len(references.position_enu_m) < POINTS:
            return ()
        columns = references.position_enu_m, references.velocity_enu_m_s, references.acceleration_enu_m_s2
        return self._points(*columns, references.yaw_rad, references.yaw_rate_rad_s)

    def _points(self, p: Array, v: Array, a: Array, yaw: Array, rate: Array) -> tuple[Forecast, ...]:
        last = len(p) - 1
        chosen = [round((point + 1) * last / POINTS) for point in range(POINTS)]
        return tuple(
            Forecast(
                (k + 1) * self._interval_s,
                tuple(p[k].tolist()),
                tuple(v[k].tolist()),
                tuple(a[k].tolist()),
                float(yaw[k]),
                float(rate[k]),
            )
            for k in chosen
        )


@compiled
def _motion(
    begin: Array,
    plan: Array,
    columns: PlanColumns,
    thrusts_n: Array,
    mass_kg: float,
    gravity_m_s2: float,
    interval_s: float,
) -> Array:
    """Return position, velocity and acceleration, ENU, (n, 9), without drag; `plan` has an initial row."""
    motion = np.zeros((thrusts_n.shape[0], 9))
    speeds, places = np.zeros(3), np.zeros(3)  # their sums; what they are multiplied by comes after
    for k in range(thrusts_n.shape[0]):
        phi, theta, psi = plan[k + 1, columns.phi], plan[k + 1, columns.theta], plan[k + 1, columns.psi]
        position, velocity, acceleration = motion[k, 0:3], motion[k, 3:6], motion[k, 6:9]
        acceleration[0] = cos(phi) * sin(theta) * cos(psi) + sin(phi) * sin(psi)
        acceleration[1] = cos(phi) * sin(theta) * sin(psi) - sin(phi) * cos(psi)
        acceleration[2] = cos(phi) * cos(theta)
        for i in range(3):
            acceleration[i] *= thrusts_n[k] / mass_kg
        acceleration[2] -= gravity_m_s2
        for i in range(3):
            speeds[i] += acceleration[i]
            velocity[i] = begin[3 + i] + interval_s * speeds[i]
            places[i] += velocity[i]
            position[i] = begin[i] + interval_s * places[i]
    return motion
