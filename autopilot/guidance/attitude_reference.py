"""Attitude demands from sticks, or a client's attitude or body rates.

Each angle is slewed with bounded rate and acceleration. The thrust direction is reached first; roll and pitch refer to
the reached yaw. Body rates are integrated by THESIS [2.7].
"""

from math import isnan, nan, radians
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.interface import AT_REST, AttitudeDemand, Preview, VehicleState
from colibri.autopilot.guidance.attitude_slew import ATTITUDE, RATE, TILT, AttitudeCommand, Slew, limit_tilt, slew_on
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.elementary import square
from colibri.common.kernels import cos
from colibri.common.rotations import nearest_turn, quaternion_from_euler, rotation_matrix
from colibri.common.types import Array, Quaternion, Vector
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, Sticks
from colibri.plant.vehicle.description import Vehicle

STICK_MIDDLE = 0.5


class AttitudeLimits(NamedTuple):
    """Limits of full sticks, of yaw ahead of the vehicle's, and of the slew."""

    stick_tilt_rad: float = radians(35.0)
    stick_yaw_rate_rad_s: float = radians(100.0)
    yaw_ahead_rad: float = radians(30.0)
    slew: Slew = Slew(
        max_tilt_rad=radians(60.0),
        tilt_frequency_rad_s=14.0,
        tilt_rate_rad_s=4.0,
        tilt_acceleration_rad_s2=60.0,
        yaw_frequency_rad_s=4.0,
        yaw_rate_rad_s=2.0,
        yaw_acceleration_rad_s2=8.0,
        thrust_rate_n_s=200.0,
    )


DEFAULT_LIMITS = AttitudeLimits()
_FREE_SLEW = DEFAULT_LIMITS.slew._replace(free=True, tilt_rate_rad_s=8.0, tilt_acceleration_rad_s2=120.0)


def attitude_limits(behaviour: Behaviour, *, free: bool = False) -> AttitudeLimits:
    """Return the limits of a vehicle's parameters, with a control law that flies in any attitude if `free`."""
    slew, rate_rad_s = _FREE_SLEW if free else DEFAULT_LIMITS.slew, behaviour.stick_yaw_rate_rad_s
    slew = slew._replace(yaw_rate_rad_s=max(slew.yaw_rate_rad_s, rate_rad_s))
    return AttitudeLimits(radians(behaviour.max_tilt_deg), rate_rad_s, DEFAULT_LIMITS.yaw_ahead_rad, slew)


class ReferenceMemory(NamedTuple):
    """Demanded angles, rad, (3,), rates and thrust."""

    angles: Array
    rates: Array
    thrust_n: float


class AttitudeReference:
    def __init__(self, vehicle: Vehicle, preview: Preview, limits: AttitudeLimits = DEFAULT_LIMITS) -> None:
        self.adopt(vehicle)
        self._interval_s = preview.interval_us * 1e-6
        self._samples = preview.samples
        self.limits = limits
        self.step(self.initial(AT_REST), AT_REST, tilt_command(0.0, 0.0, 0.0, self.weight_n))

    def obey(self, behaviour: Behaviour) -> None:
        self.limits = attitude_limits(behaviour, free=self.limits.slew.free)

    def adopt(self, vehicle: Vehicle) -> None:
        self.weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
        self.max_thrust_n = float(vehicle.allocation()[0].sum()) * square(vehicle.rotors.max_speed)

    def initial(self, state: VehicleState) -> ReferenceMemory:
        angles, rates = np.array(state.euler), np.zeros(3)
        limit_tilt(angles, rates, self.limits.slew.max_tilt_rad)
        return ReferenceMemory(angles, rates, self.weight_n)

    def step(
        self, memory: ReferenceMemory, state: VehicleState, command: AttitudeCommand
    ) -> tuple[ReferenceMemory, AttitudeDemand]:
        angles, rates = np.empty((self._samples + 1, 3)), np.empty((self._samples + 1, 3))
        thrusts = np.empty(self._samples + 1)
        angles[0], rates[0], thrusts[0] = memory.angles, memory.rates, memory.thrust_n
        phi, theta, psi = memory.angles.tolist()
        steep = cos(phi) * cos(theta) < cos(self.limits.slew.max_tilt_rad)
        if steep and command.kind != ATTITUDE:
            angles[0] = euler_from_quaternion(quaternion_from_euler(phi, theta, psi))
        if not (steep and self.limits.slew.free):
            angles[0, 2] = self._near(angles[0, 2].item(), state.euler[2])
        slew_on(command, self.weight_n, self.limits.slew, self._interval_s, angles, rates, thrusts)
        after = ReferenceMemory(angles[1].copy(), rates[1].copy(), thrusts[1].item())
        return after, AttitudeDemand(angles[:-1], rates[:-1], thrusts[:-1])

    def from_sticks(self, sticks: Sticks) -> AttitudeCommand:
        tilt = self.limits.stick_tilt_rad
        yaw_rate = -self.limits.stick_yaw_rate_rad_s * sticks.yaw
        return tilt_command(tilt * sticks.roll, tilt * sticks.pitch, yaw_rate, self.thrust_for_stick(sticks.thrust))

    def from_setpoint(self, setpoint: AttitudeSetpoint) -> AttitudeCommand:
        """Convert a setpoint: attitude takes precedence over rates, of which only yaw's is then fed forward."""
        thrust_n = nan if isnan(setpoint.thrust) else self.thrust_for_stick(setpoint.thrust)
        p, q, r = (0.0 if isnan(rate) else rate for rate in setpoint.rate_flu_rad_s)
        if setpoint.attitude is None:
            return rate_command((p, q, r), thrust_n)
        return attitude_command(setpoint.attitude, thrust_n, r)

    def thrust_for_stick(self, stick: float) -> float:
        """Convert a stick, 0..1, to thrust, N; half hovers, as ground stations for PX4 expect."""
        if stick <= STICK_MIDDLE:
            return self.weight_n * max(stick, 0.0) / STICK_MIDDLE
        part = (min(stick, 1.0) - STICK_MIDDLE) / (1.0 - STICK_MIDDLE)
        return self.weight_n + (self.max_thrust_n - self.weight_n) * part

    def _near(self, psi: float, yaw_rad: float) -> float:
        max_ahead = self.limits.yaw_ahead_rad
        return min(max(nearest_turn(psi, yaw_rad), yaw_rad - max_ahead), yaw_rad + max_ahead)


def tilt_command(phi: float, theta: float, yaw_rate_rad_s: float, thrust_n: float) -> AttitudeCommand:
    """Command roll and pitch, rad, at the present heading."""
    return AttitudeCommand(TILT, (phi, theta, 0.0), 0.0, yaw_rate_rad_s, thrust_n)


def attitude_command(attitude: Quaternion, thrust_n: float, yaw_rate_rad_s: float = 0.0) -> AttitudeCommand:
    """Command an attitude; yaw is reached more slowly than the thrust direction."""
    (_, _, x), (_, _, y), (_, _, z) = rotation_matrix(attitude)
    return AttitudeCommand(ATTITUDE, (x, y, z), euler_from_quaternion(attitude)[2], yaw_rate_rad_s, thrust_n)


def rate_command(rate_flu_rad_s: Vector, thrust_n: float) -> AttitudeCommand:
    return AttitudeCommand(RATE, rate_flu_rad_s, 0.0, 0.0, thrust_n)
