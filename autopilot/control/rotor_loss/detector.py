"""Detection of a lost rotor from missing thrust and moments.

Inverted equations of motion give force along z and moments between two samples. Against the commanded, lagging rotors a
dead rotor i leaves -fᵢ aᵢ, with its expected thrust fᵢ and aᵢ = (1, yᵢ, -xᵢ, κᵢ).

Each rotor's CUSUM (E. S. Page, Biometrika 41, 1954) sums the log likelihood ratio of "dead" against "weak by a quarter,
with any moments of inertia". It grows below 0.375 of the expected thrust, about the least for a hover. One sample is
bounded: a jump of the estimate cannot raise the alarm. Moments alone are no evidence: lift must drop with them, by part
of the rotor's thrust below its recent mean. The ground and a failed gyroscope cause moments, but no such drop.
Two coaxial rotors differ in their yaw moments alone: the alarm waits until one of them is `_CLEARLY` more likely.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.interface import AT_REST, VehicleState
from colibri.autopilot.control.vehicle_model.airframe import airframe_of
from colibri.autopilot.control.vehicle_model.battery import BatteryModel, terminal
from colibri.autopilot.control.vehicle_model.rotor_lag import SampledLag, follow, rotor_lag
from colibri.common.compiled_rotations import rotation_matrix
from colibri.common.elementary import square
from colibri.common.jit import Packed, compiled, opened, packed
from colibri.common.matrices import matvec, put
from colibri.common.types import Array, PerRotor, Quaternion, Vector
from colibri.plant.vehicle.description import AXES, Vehicle

ALARM = 20.0  # log odds: e²⁰ samples are a century
_CLEARLY = 3.0  # log odds against the next rotor
MAX_EVIDENCE = 10.0  # from one sample: an alarm takes two
_WEAK = 0.25  # thrust loss of a weak rotor; the decision threshold is half way from here to 1
_INERT, _AGILE = -0.4, 1.0  # relative error of the expected turn: moments of inertia 1.67 or 0.5 times the nominal
_NOISE_PART = 1.0 / 64.0  # filter gain of the noise variances, which make failing sensors count less
_USUAL_PART = 1.0 / 64.0  # filter gain of the force's mean, which holds errors of mass and steady wind
_PUSH_PART, _MAX_PUSH = 0.25, 1.0  # filter gain and bound of a moment that the rotors do not cause
_MAX_JOLT, _JOLT_PART = 3.0, 0.1  # bounds of a force that the rotors do not cause, in parts of the weight
_DROP = 0.4  # least drop of the force, in parts of the rotor's expected thrust
# Deviations of the residual by errors of the model, in parts of a quarter of the weight and its moments.
_FORCE_PART, _TILT_PART, _YAW_PART = 0.6, 0.1, 0.5


class Signature(NamedTuple):
    """Effect of a vehicle's rotors, and constants of the detector; forces in N at the largest speed."""

    full_thrust_n: Array  # of each rotor, (m,)
    effect: Array  # force along z and moments about x, y, z for each N of rotor i in column i, (4, m)
    momentum: Array  # of each rotor at the largest speed, N m s, (m,)
    inertia: Array  # kg m², (3,)
    variances: Array  # of the residual, N² and N² m², (4,)
    mass_kg: float
    gravity_m_s2: float
    yaw_drag_n_m_s: float  # of the hubs in hover, which hides the yaw of small rotors; 0 for four
    lag: SampledLag
    interval_s: float


def signature_of(vehicle: Vehicle, interval_s: float) -> Signature:
    allocation = vehicle.allocation()
    turning = allocation[0] != 0.0
    effect = allocation / np.where(turning, allocation[0], 1.0)
    lift_n = vehicle.body.mass_kg * vehicle.gravity_m_s2 / 4.0
    arm_m = float(np.sqrt(effect[1] * effect[1] + effect[2] * effect[2])[turning].mean())
    yaw_m = float(np.abs(effect[3])[turning].mean())
    deviations = lift_n * np.array([_FORCE_PART, _TILT_PART * arm_m, _TILT_PART * arm_m, _YAW_PART * yaw_m])
    return Signature(
        allocation[0] * square(vehicle.rotors.max_speed),
        effect,
        vehicle.momentum_along_z() * vehicle.rotors.max_speed,
        np.array(vehicle.body.inertia_kg_m2),
        deviations**2,
        vehicle.body.mass_kg,
        vehicle.gravity_m_s2,
        _yaw_drag_n_m_s(vehicle),
        rotor_lag(vehicle, interval_s),
        interval_s,
    )


def _yaw_drag_n_m_s(vehicle: Vehicle) -> float:
    if vehicle.drag is None or vehicle.rotors.count == len(AXES):
        return 0.0
    x, y, _ = vehicle.arms_m().T
    return vehicle.drag.rotor_coefficient * vehicle.hover_speed * float((x * x + y * y).sum())


class DetectorState(NamedTuple):
    speeds: Array  # of the rotors, parts of the largest, (m,)
    motion: Array  # velocity, m/s, ENU; rates, rad/s, FLU; body z axis, ENU: (9,)
    evidence: Array  # CUSUM of each rotor, (m,)
    odds: Array  # the same without the bound on one sample, (m,)
    residual: Array  # force and moments, N and N m, (4,)
    noise: Array  # variances of the residual's changes, (4,)
    usual: Array  # mean of the residual force, N, (1,)
    push: Array  # filtered residual moments about x and y, and their means, in parts of a quarter of the weight's, (4,)
    jolt: Array  # recent impulse along z, s of weight, and the mean of its force, parts of the weight, (2,)


class RotorWatch:
    def __init__(self, vehicle: Vehicle, interval_s: float) -> None:
        self._interval_s = interval_s
        self.lost: int | None = None  # index, permanently
        self.max_evidence = 0.0
        rotors = vehicle.rotors.count
        self._memory = packed(DetectorState(*map(np.zeros, (rotors, 9, rotors, rotors, 4, 4, 1, 4, 2))))
        self._kept = opened(self._memory, DetectorState)
        self.adopt(vehicle)
        stopped = vehicle.rotors.stopped
        self._take_in(AT_REST, stopped, 0.0, counts=True)
        self.begin(stopped)

    @property
    def speeds(self) -> Array:
        return self._kept.speeds.copy()

    @speeds.setter
    def speeds(self, speeds: Array) -> None:
        self._kept.speeds[:] = speeds

    @property
    def expected(self) -> tuple[float, float, float, float, float, float]:
        """Drag across and along the rotors' axes, over that across in hover; thrust, m/s²; turn, rad/s², FLU."""
        thrust, p, q, r = (matvec(self._accelerations, self._kept.speeds**2)).tolist()
        air, weight = self._airframe, self._airframe.gravity_m_s2
        now, hover = (air.drag_xy + air.rotor_drag * sqrt(air.mass_kg * max(each, 0.0)) for each in (thrust, weight))
        across, along = (now / hover, air.drag_z / hover) if hover > 0.0 else (1.0, 1.0)
        return across, along, thrust, p, q, r

    @property
    def push(self) -> float:
        """Tilting moment that the rotors do not cause, as by feet on the ground: 1 for a quarter of the weight."""
        x, y, *_ = self._kept.push.tolist()
        return max(abs(x), abs(y)) if self.lost is None else 0.0

    @property
    def jolt_s(self) -> float:
        """Recent impulse along body z that the rotors do not cause, as by the ground, in seconds of weight."""
        return float(self._kept.jolt[0])

    def adopt(self, vehicle: Vehicle) -> None:
        self._battery, self._airframe = BatteryModel(vehicle), airframe_of(vehicle)
        signature = signature_of(vehicle, self._interval_s)
        inertia = np.array([signature.mass_kg, *signature.inertia])
        self._accelerations = signature.effect * signature.full_thrust_n / inertia[:, None]
        self._numbers = packed(signature)

    def begin(self, controls: PerRotor) -> None:
        kept = self._kept
        self.speeds = np.array(controls)
        kept.evidence[:] = kept.odds[:] = kept.residual[:] = kept.noise[:] = kept.usual[:] = 0.0
        kept.push[:] = kept.jolt[:] = 0.0
        self._began = False

    def step(self, state: VehicleState, controls: PerRotor, charge_ah: float, *, airborne: bool) -> int | None:
        likeliest, most = self._take_in(state, controls, charge_ah, counts=airborne and self._began)
        self._began = True
        self.max_evidence = max(self.max_evidence, most)
        if self.lost is None and most >= ALARM:
            self.lost = likeliest
        return self.lost

    def _take_in(self, state: VehicleState, controls: PerRotor, charge_ah: float, *, counts: bool) -> tuple[int, float]:
        _, velocity, attitude, _, rate, *_ = state
        battery = self._battery
        found: tuple[int, float] = _take_in(
            velocity, attitude, rate, controls, battery.open_voltage_v(charge_ah), counts,
            self._numbers, battery.numbers, self._memory,
        )  # fmt: skip
        return found


@compiled
def _take_in(
    velocity_enu_m_s: Vector,
    attitude: Quaternion,
    rate_flu_rad_s: Vector,
    controls: PerRotor,
    open_v: float,  # of the battery without load
    counts: bool,  # else evidence is reset
    numbers: Packed,
    battery: Packed,
    memory: Packed,
) -> tuple[int, float]:
    kept, known = memory[0], numbers[0]
    speeds_before, before = kept.speeds.copy(), kept.motion.copy()
    max_speed = terminal(open_v, speeds_before, battery)[0] / battery[0].full_voltage_v
    commands = np.empty_like(speeds_before)
    for i in range(speeds_before.shape[0]):
        commands[i] = min(max(controls[i], known.lag.min_speed), max_speed)
    put(follow(speeds_before, commands, known.lag), kept.speeds)
    R = rotation_matrix(attitude)
    for i in range(3):
        kept.motion[i], kept.motion[3 + i], kept.motion[6 + i] = velocity_enu_m_s[i], rate_flu_rad_s[i], R[i][2]
    residual, expected, thrust_n = _residual(kept, before, speeds_before, known)
    _feel_push(kept.push, residual, known.variances)
    _feel_jolt(kept.jolt, residual[0] / (known.mass_kg * known.gravity_m_s2), known.interval_s)
    if not counts:
        kept.evidence[:] = kept.odds[:] = kept.usual[:] = 0.0
        return 0, 0.0
    return _add_evidence(kept, residual, expected, thrust_n, known)


@compiled
def _residual(
    memory: DetectorState, before: Array, speeds_before: Array, rotors: Signature
) -> tuple[Array, Array, Array]:
    """Return force and moments beyond those of the rotors, those of the rotors, and the thrust of each."""
    now, speeds, interval_s = memory.motion, memory.speeds, rotors.interval_s
    rotor_count = len(rotors.momentum)
    thrust_n = np.empty(rotor_count)
    h, h_rate = 0.0, 0.0
    for i in range(rotor_count):
        squared = 0.5 * (speeds_before[i] * speeds_before[i] + speeds[i] * speeds[i])
        thrust_n[i] = rotors.full_thrust_n[i] * squared
        h += rotors.momentum[i] * 0.5 * (speeds_before[i] + speeds[i])
        h_rate += rotors.momentum[i] * (speeds[i] - speeds_before[i]) / interval_s
    ix, iy, iz = rotors.inertia[0], rotors.inertia[1], rotors.inertia[2]
    p, q, r = 0.5 * (before[3] + now[3]), 0.5 * (before[4] + now[4]), 0.5 * (before[5] + now[5])
    residual, expected = np.zeros(4), np.zeros(4)
    for i in range(3):
        acceleration = (now[i] - before[i]) / interval_s + (rotors.gravity_m_s2 if i == 2 else 0.0)
        residual[0] += rotors.mass_kg * acceleration * 0.5 * (before[6 + i] + now[6 + i])
    residual[1] = ix * (now[3] - before[3]) / interval_s - (iy - iz) * q * r + q * h
    residual[2] = iy * (now[4] - before[4]) / interval_s - (iz - ix) * p * r - p * h
    residual[3] = iz * (now[5] - before[5]) / interval_s - (ix - iy) * p * q + h_rate
    residual[3] += rotors.yaw_drag_n_m_s * r
    for row in range(4):
        for i in range(rotor_count):
            expected[row] += rotors.effect[row, i] * thrust_n[i]
        residual[row] -= expected[row]
    return residual, expected, thrust_n


@compiled
def _feel_push(push: Array, residual: Array, variances: Array) -> None:
    for i in range(2):
        part = _TILT_PART * residual[1 + i] / sqrt(variances[1 + i])
        push[i] += _PUSH_PART * (min(max(part - push[2 + i], -_MAX_PUSH), _MAX_PUSH) - push[i])
        push[2 + i] += _USUAL_PART * min(max(part - push[2 + i], -_TILT_PART), _TILT_PART)


@compiled
def _feel_jolt(jolt: Array, force: float, interval_s: float) -> None:
    beyond = min(max(force - jolt[1], -_MAX_JOLT), _MAX_JOLT)
    jolt[0] = max(jolt[0] + (beyond - _JOLT_PART) * interval_s, 0.0)
    jolt[1] += _USUAL_PART * min(max(beyond, -_JOLT_PART), _JOLT_PART)


@compiled
def _add_evidence(
    memory: DetectorState, residual: Array, expected: Array, thrust_n: Array, rotors: Signature
) -> tuple[int, float]:
    """Add a sample to the CUSUMs in place; return the likeliest rotor, and its value, below `ALARM` while in doubt."""
    evidence, last, noise, rotor_count = memory.evidence, memory.residual, memory.noise, len(rotors.momentum)
    for row in range(4):
        change = residual[row] - last[row]
        noise[row] += _NOISE_PART * (0.5 * change * change - noise[row])
        last[row] = residual[row]
    lift_n = rotors.mass_kg * rotors.gravity_m_s2 / rotor_count
    drop_n = memory.usual[0] - residual[0]
    memory.usual[0] -= _USUAL_PART * min(max(drop_n, -lift_n), lift_n)
    likeliest, odds, doubtful = 0, memory.odds, False
    for i in range(rotor_count):
        added = 0.0
        for row in range(4):
            missing = rotors.effect[row, i] * thrust_n[i]
            weak, none = residual[row] + _WEAK * missing, residual[row] + missing
            if row > 0:
                minimum, maximum = _INERT * expected[row], _AGILE * expected[row]
                if minimum > maximum:
                    minimum, maximum = maximum, minimum
                weak -= min(max(weak, minimum), maximum)
            added += 0.5 * (weak * weak - none * none) / (rotors.variances[row] + noise[row])
        most = MAX_EVIDENCE if drop_n > _DROP * rotors.effect[0, i] * thrust_n[i] else 0.0
        evidence[i] = max(evidence[i] + min(added, most), 0.0)
        odds[i] = max(odds[i] + added, 0.0) if evidence[i] > 0.0 else 0.0
        if odds[i] > odds[likeliest]:
            likeliest = i
    for i in range(rotor_count):
        doubtful |= i != likeliest and evidence[i] >= ALARM and odds[i] > odds[likeliest] - _CLEARLY
    return likeliest, min(evidence[likeliest], 0.99 * ALARM) if doubtful else evidence[likeliest]
