"""Landing on three rotors: position and height control, and the allocation to the rotors."""

from functools import lru_cache
from math import hypot, radians

import numpy as np

from colibri.autopilot.control.interface import Decision, Diagnostics, Fallback, VehicleState
from colibri.autopilot.control.rotor_loss.reduced_attitude import ReducedAttitude, Trio
from colibri.autopilot.control.vehicle_model import disturbance_observer
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.rotor_lag import follow, lead, rotor_lag
from colibri.common.elementary import square
from colibri.common.kernels import atan2, cos, sin, tan
from colibri.common.matrices import dot, matvec, norm
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array, Vector
from colibri.plant.vehicle.description import Vehicle

_MAX_SPIN_RAD_S = 28.0
_SPIN_PART = 0.8  # of the gyroscope's range; the rest is for transients
_SPUN_UP_RAD_S = 10.0
_SPIN_UP_THRUST = 1.3  # parts of the weight: until it spins, the thrust axis can turn in one direction only
_MIN_UPRIGHT = 0.5
_AT_LIMIT = 1e-9

_PLACE_RAD_S = 1.0  # bandwidth of the position loop, critically damped
_CLIMB_1_S, _LIFT_M_S2 = 3.0, 4.0  # gain on vertical speed, largest vertical acceleration
_TILT_DEG, _MAX_TILT_DEG = 6.0, 8.0  # largest tilt for position, then for position and wind; cone excluded
_FARTHER_DEG_M, _FAR_M, _WIND_TILT_DEG = 2.0, 1.5, 16.0  # extra tilt per metre beyond _FAR_M; largest tilt
_WIND_RAD_S, _MAX_WIND_M_S2 = 1.5, 2.0  # bandwidth and limit of the disturbance observer
_SETTLE_S, _SINK_M_S, _LAND_M_S, _LAND_ABOVE_M = 1.5, 1.0, 0.6, 2.0  # hover time, sink rates high and low
_KNOCK, _JUMP = 0.35, 0.25  # touch-down: upward impulse near the ground, parts of _LAND_M_S, and its largest sample
_KNOCK_FADES = 0.25  # of the impulse, in parts of gravity: a correction of the estimate comes in one sample
_STAYS_M_S, _STAYS_S = 0.2, 1.5  # touch-down: slower than this for so long in spite of the commanded sink rate


class ThreeRotors:
    """Flies one vehicle without a rotor until touch-down."""

    def __init__(
        self,
        vehicle: Vehicle,
        law: ReducedAttitude,
        interval_s: float,
        speeds: Array,
        state: VehicleState,
        ground_m: float,
    ) -> None:
        self._vehicle, self._interval_s = vehicle, interval_s
        self._lag = rotor_lag(vehicle, interval_s)
        self.law = law
        self._battery = BatteryModel(vehicle)
        self._full_n = vehicle.allocation()[0] * square(vehicle.rotors.max_speed)
        self._gravity = vehicle.gravity_m_s2
        self._weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
        self._speeds = speeds.copy()
        self._speeds[law.trio.lost] = 0.0
        self._tilt_m_s2 = self._gravity * tan(radians(_TILT_DEG))
        self._ground_m = ground_m
        (x, y, z), (vx, vy, _) = state.position_enu_m, state.velocity_enu_m_s
        stops_s = hypot(vx, vy) / self._tilt_m_s2  # braked by half of the tilt
        self._place = np.array([x + vx * stops_s, y + vy * stops_s, z])
        self._gains = disturbance_observer.gains(_WIND_RAD_S, interval_s)
        self._velocity, self._wind = np.array(state.velocity_enu_m_s), np.zeros(3)
        self._explained = np.zeros(3)
        self._elapsed_s = self._held_s = self._knock_m_s = 0.0
        self._climbed_m_s = state.velocity_enu_m_s[2]
        self.landed = False
        self.controls = (0.0, 0.0, 0.0, 0.0)

    def step(self, state: VehicleState, charge_ah: float) -> Decision:
        self._elapsed_s += self._interval_s
        R = np.array(rotation_matrix(state.attitude))
        self._observe(state)
        up = self._acceleration(state)
        up[2] += self._gravity
        direction = up / norm(up)
        thrust_n = self._weight_n / self._gravity * float(up[2]) / max(float(R[2, 2]), _MIN_UPRIGHT)
        if abs(state.rate_flu_rad_s[2]) < _SPUN_UP_RAD_S:
            thrust_n = max(thrust_n, _SPIN_UP_THRUST * self._weight_n)
        commands = self._commands(thrust_n, matvec(R.T, direction), np.array(state.rate_flu_rad_s), charge_ah)
        self._turn(commands, R[:, 2])
        self._watch_ground(state)
        c1, c2, c3, c4 = (0.0, 0.0, 0.0, 0.0) if self.landed else commands.tolist()
        self.controls = (c1, c2, c3, c4)
        speeds = np.array(self.controls) * self._vehicle.rotors.max_speed
        return Decision(speeds, angles_of(direction, state.euler[2]), Diagnostics(fallback=Fallback.THREE_ROTORS))

    def _commands(self, thrust_n: float, direction: Array, rate: Array, charge_ah: float) -> Array:
        lost, a, b, o, _ = self.law.trio
        forces = self._full_n * self._speeds**2
        d, f_o = self.law.command(direction, rate, np.array([forces[b] - forces[a], forces[o]]))
        max_speed = self._battery.max_speed_now(charge_ah, self._speeds)
        limits = square(self._lag.min_speed), square(max_speed)
        squared = shared(self.law.trio, thrust_n, d, f_o, self._full_n, limits)
        commands = lead(self._speeds, squared, self._lag, max_speed)
        minimum = self._lag.min_speed  # all that the rotor has, not the plan's
        commands[squared <= square(minimum) + _AT_LIMIT] = minimum
        commands[squared >= square(max_speed) - _AT_LIMIT] = max_speed
        commands[lost] = 0.0
        return commands

    def _turn(self, commands: Array, up: Array) -> None:
        before, self._speeds = self._speeds, follow(self._speeds, commands, self._lag)
        thrust_n = 0.5 * dot(self._full_n, before**2 + self._speeds**2)
        self._explained = thrust_n / self._weight_n * self._gravity * up
        self._explained[2] -= self._gravity

    def _observe(self, state: VehicleState) -> None:
        expected = self._velocity + self._interval_s * (self._explained + self._wind)
        missed = np.array(state.velocity_enu_m_s) - expected
        pushed_m_s = state.velocity_enu_m_s[2] - self._climbed_m_s - self._interval_s * float(self._explained[2])
        fades_m_s = _KNOCK_FADES * self._gravity * self._interval_s
        self._knock_m_s = max(self._knock_m_s + min(pushed_m_s, _JUMP * _LAND_M_S) - fades_m_s, 0.0)
        self._climbed_m_s = state.velocity_enu_m_s[2]
        self._velocity = expected + self._gains[0] * missed
        self._wind = np.clip(self._wind + self._gains[1] * missed, -_MAX_WIND_M_S2, _MAX_WIND_M_S2)

    def _acceleration(self, state: VehicleState) -> Array:
        w = _PLACE_RAD_S
        velocity = np.array(state.velocity_enu_m_s)
        error = self._place - np.array(state.position_enu_m)
        wanted: Array = w * w * error - 2.0 * w * velocity
        _limit(wanted, self._tilt_m_s2)
        wanted[2] = _CLIMB_1_S * (self._climb_m_s(state) - velocity[2])
        wanted -= self._wind
        tilt_deg = _MAX_TILT_DEG + _FARTHER_DEG_M * max(hypot(error[0], error[1]) - _FAR_M, 0.0)
        _limit(wanted, self._gravity * tan(radians(min(tilt_deg, _WIND_TILT_DEG))))
        wanted[2] = min(max(wanted[2], -_LIFT_M_S2), _LIFT_M_S2)
        return wanted

    def _climb_m_s(self, state: VehicleState) -> float:
        if self._elapsed_s < _SETTLE_S:
            return 0.0
        return -_SINK_M_S if state.position_enu_m[2] - self._ground_m > _LAND_ABOVE_M else -_LAND_M_S

    def _watch_ground(self, state: VehicleState) -> None:
        sinks = self._climb_m_s(state) < 0.0
        low = state.position_enu_m[2] - self._ground_m < _LAND_ABOVE_M
        vx, vy, vz = state.velocity_enu_m_s
        stays = abs(vz) < _STAYS_M_S if low else hypot(vx, vy, vz) < _STAYS_M_S  # on the ground it may slide
        self._held_s = self._held_s + self._interval_s if sinks and stays else 0.0
        knocked = low and sinks and self._knock_m_s > _KNOCK * _LAND_M_S
        self.landed = self.landed or knocked or self._held_s >= _STAYS_S


@lru_cache(maxsize=16)
def law_without(vehicle: Vehicle, lost: int, interval_s: float) -> ReducedAttitude:
    measured = vehicle.sensors.gyroscope.range_rad_s * _SPIN_PART if vehicle.sensors else _MAX_SPIN_RAD_S
    follows = rotor_lag(vehicle, interval_s).planned
    return ReducedAttitude(vehicle, lost, interval_s, follows, min(_MAX_SPIN_RAD_S, measured))


def shared(
    trio: Trio, thrust_n: float, d: float, f_o: float, full_n: Array, squared_limits: tuple[float, float]
) -> Array:
    """Return squared rotor speeds, parts of the largest, (4,): thrust direction first, then thrust.

    Demanded are the sum, `d`, thrust of b minus a, and `f_o`, N; `full_n` are the largest, (4,).
    """
    minimum, maximum = squared_limits
    min_n = minimum * max(full_n[trio.a], full_n[trio.b])
    max_n = maximum * min(full_n[trio.a], full_n[trio.b])
    f_o = min(max(f_o, minimum * full_n[trio.o]), maximum * full_n[trio.o])
    d = min(max(d, min_n - max_n), max_n - min_n)
    pair_n = min(max(thrust_n - f_o, 2.0 * min_n + abs(d)), 2.0 * max_n - abs(d))
    forces = np.zeros(4)
    forces[trio.a], forces[trio.b], forces[trio.o] = 0.5 * (pair_n - d), 0.5 * (pair_n + d), f_o
    squared: Array = forces / full_n
    return squared


def _limit(acceleration: Array, max_acceleration_m_s2: float) -> None:
    flat = hypot(acceleration[0], acceleration[1])
    if flat > max_acceleration_m_s2:
        acceleration[:2] *= max_acceleration_m_s2 / flat


def angles_of(direction: Array, psi: float) -> Vector:
    x, y, z = direction.tolist()
    forward, left = cos(psi) * x + sin(psi) * y, cos(psi) * y - sin(psi) * x
    return (atan2(-left, hypot(forward, z)), atan2(forward, z), psi)
