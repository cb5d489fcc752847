"""Delay compensation: the vehicle's state at the time a new command takes effect.

The model carries the state ahead with the commands already sent and the observed disturbance. The delay is declared, or
the median of the plant's reports in simulated time.
"""

from collections import deque

import numpy as np

from colibri.autopilot.control.vehicle_model import motion
from colibri.autopilot.control.vehicle_model.battery import open_voltage_v
from colibri.common.jit import packed
from colibri.common.kernels import exp
from colibri.common.types import Array, PerRotor
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.plant.vehicle.description import Vehicle

MAX_DELAY_US = 200_000  # longer delays are compensated as this one
_MEDIAN_OF = 25
_WORTH_US = 1_000  # a smaller change of the measured delay is ignored: references must not jitter
_CONTINUES_US = 100_000  # after a longer gap the rotors restart at their commands and the disturbance at zero
_DISTURBANCE_RAD_S = 10.0
_MAX_DISTURBANCE = np.array([6.0, 6.0, 6.0, 60.0, 60.0, 60.0])  # m/s², rad/s²


class DelayCompensation:
    def __init__(self, vehicle: Vehicle, declared_s: float | None = None) -> None:
        """Compensate the declared delay, or with None the measured one."""
        self._measured: deque[int] = deque(maxlen=_MEDIAN_OF)
        self._median_us = self.delay_us = 0
        self._declared_s: float | None = None
        self.declare(declared_s)
        self.adopt(vehicle)
        self.begin(vehicle.rotors.stopped)
        x = np.zeros(motion.RIGID + vehicle.rotors.count)
        motion.carry(x, np.zeros(1), np.zeros((1, vehicle.rotors.count)), self._disturbance, 1.0, self._model)
        motion.thrust_n(x[motion.ROTORS], self._model)

    def adopt(self, vehicle: Vehicle) -> None:
        self._vehicle, self._model = vehicle, packed(motion.motion_model(vehicle))

    def declare(self, declared_s: float | None) -> None:
        self._declared_s = declared_s
        self._choose()

    def measure(self, delay_us: int) -> None:
        self._measured.append(delay_us)
        median_us = sorted(self._measured)[(len(self._measured) - 1) // 2]
        if abs(median_us - self._median_us) >= _WORTH_US:
            self._median_us = median_us
            self._choose()

    def begin(self, controls: PerRotor, *, rests: bool = False) -> None:
        """Start with the rotors at `controls`; a vehicle at rest stays until they lift it."""
        self._sent = deque([ActuatorCommand(0, controls, armed=any(controls))])
        self._known: tuple[int, Array] | None = None  # time, µs, and x of the previous frame
        self._rests = rests
        self._disturbance = np.zeros(6)

    def sent(self, command: ActuatorCommand) -> None:
        sent = self._sent
        if command.controls == sent[-1].controls and command.armed == sent[-1].armed:
            return
        sent.append(command)
        while sent[1].time_us < command.time_us - MAX_DELAY_US - _CONTINUES_US:
            sent.popleft()

    def ahead(self, frame: StateFrame, charge_ah: float, *, standing: bool = False) -> StateFrame:
        if self.delay_us == 0:
            self._known = None
            return frame
        battery = self._vehicle.battery
        voltage_v = 1.0 if battery is None else open_voltage_v(battery, charge_ah)
        x = self._now(frame, voltage_v)
        self._known = (frame.time_us, x)
        weight_n = self._vehicle.body.mass_kg * self._vehicle.gravity_m_s2
        self._rests = standing or (self._rests and motion.thrust_n(x[motion.ROTORS], self._model) < weight_n)
        if self._rests:
            self._disturbance = np.zeros(6)
            return frame
        return _frame(frame.time_us + self.delay_us, self._carried(x, frame.time_us, self.delay_us, voltage_v))

    def _choose(self) -> None:
        delay_us = self._median_us if self._declared_s is None else round(self._declared_s * 1e6)
        self.delay_us = min(max(delay_us, 0), MAX_DELAY_US)

    def _now(self, frame: StateFrame, voltage_v: float) -> Array:
        now_us, known = frame.time_us, self._known
        measured = (*frame.position_enu_m, *frame.velocity_enu_m_s, *frame.attitude, *frame.rate_flu_rad_s)
        x = np.array((*measured, *self._speeds(self._acting(now_us)[0])))
        if known is None or not 0 < now_us - known[0] <= _CONTINUES_US:
            self._disturbance = np.zeros(6)
            return x
        passed_us = now_us - known[0]
        expected = self._carried(known[1], known[0], passed_us, voltage_v)
        x[motion.ROTORS] = expected[motion.ROTORS]
        missed = (x - expected)[[3, 4, 5, 10, 11, 12]] / (passed_us * 1e-6)
        part = 1.0 - exp(-_DISTURBANCE_RAD_S * passed_us * 1e-6)
        self._disturbance = np.clip(self._disturbance + part * missed, -_MAX_DISTURBANCE, _MAX_DISTURBANCE)
        return x

    def _carried(self, x: Array, from_us: int, duration_us: int, voltage_v: float) -> Array:
        acting = self._acting(from_us, from_us + duration_us)
        begins = [from_us, *(it.time_us + self.delay_us for it in acting[1:]), from_us + duration_us]
        durations_s = np.diff(np.array(begins)) * 1e-6
        speeds = np.array([self._speeds(it) for it in acting])
        return motion.carry(x, durations_s, speeds, self._disturbance, voltage_v, self._model)

    def _acting(self, from_us: int, until_us: int = 0) -> list[ActuatorCommand]:
        acting = [self._sent[0]]
        for it in self._sent:
            acts_us = it.time_us + self.delay_us
            if acts_us <= from_us:
                acting = [it]
            elif acts_us < until_us:
                acting.append(it)
        return acting

    def _speeds(self, command: ActuatorCommand) -> PerRotor:
        rotors = self._vehicle.rotors
        if not command.armed:
            return rotors.stopped
        return tuple(max(control * rotors.max_speed, rotors.idle_speed) for control in command.controls)


def _frame(time_us: int, x: Array) -> StateFrame:
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, p, q, r, *_ = x.tolist()
    return StateFrame(time_us, (px, py, pz), (vx, vy, vz), (qw, qx, qy, qz), (p, q, r))
