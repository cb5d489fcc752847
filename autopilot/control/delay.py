"""Delay compensation: the state that the vehicle will have when the command that is decided now takes effect.

Whatever decides is given the vehicle as it will be a delay later: carried there by the vehicle model, by the commands
that were sent and have not acted yet, and by the disturbance, which is observed as what each state differs by from the
one predicted for it. References are those of that instant, too. So a control law finds what it is made for, commands
that act at once.

The delay is declared or measured: the plant reports how long after its frame each command took effect, and the median
of the last ones is compensated. Simulated time alone counts, so the same frames give the same flight.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.vehicle_model import motion
from colibri.autopilot.control.vehicle_model.battery import open_voltage_v
from colibri.common.jit import packed
from colibri.common.kernels import exp
from colibri.common.types import Array, FourRotors
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.plant.vehicle.description import Vehicle

MAX_DELAY_US = 200_000
"""A longer delay is compensated as if it were this one."""
NO_ROTORS = (0.0, 0.0, 0.0, 0.0)
_MEDIAN_OF = 25
_WORTH_US = 1_000
"""A measured delay is taken over where it differs by this: references are not to tremble with it."""
_CONTINUES_US = 100_000
"""After a longer gap the rotors turn as they were commanded, and nothing is known of disturbances."""
_DISTURBANCE_RAD_S = 10.0
_MAX_DISTURBANCE = np.array([6.0, 6.0, 6.0, 60.0, 60.0, 60.0])
"""Acceleration, m/s², and angular acceleration, rad/s²."""


class _Known(NamedTuple):
    """The last state that was known: its time, and `motion`'s x."""

    time_us: int
    x: Array


class DelayCompensation:
    """Compensates the delay of one vehicle's commands.

    Attributes:
        delay_us: From a frame to the moment at which the command that answers it takes effect, as it is compensated.
    """

    def __init__(self, vehicle: Vehicle, declared_s: float | None = None) -> None:
        """Compensate the declared delay, or with None the measured one; compiled code is loaded here."""
        self._measured: deque[int] = deque(maxlen=_MEDIAN_OF)
        self._median_us = self.delay_us = 0
        self._declared_s: float | None = None
        self.declare(declared_s)
        self.adopt(vehicle)
        self.begin(NO_ROTORS)
        x = np.zeros(motion.STATES)
        motion.carry(x, np.zeros(1), np.zeros((1, 4)), self._disturbance, 1.0, self._model)
        motion.thrust_n(x[motion.ROTORS], self._model)

    def adopt(self, vehicle: Vehicle) -> None:
        """Predict with other numbers of the vehicle."""
        self._vehicle, self._model = vehicle, packed(motion.motion_model(vehicle))

    def declare(self, declared_s: float | None) -> None:
        """Compensate this delay from now on; None: the measured one."""
        self._declared_s = declared_s
        self._choose()

    def measure(self, delay_us: int) -> None:
        """Take in how late a command took effect."""
        self._measured.append(delay_us)
        median_us = sorted(self._measured)[(len(self._measured) - 1) // 2]
        if abs(median_us - self._median_us) >= _WORTH_US:
            self._median_us = median_us
            self._choose()

    def begin(self, controls: FourRotors, *, rests: bool = False) -> None:
        """Begin with the rotors turning at `controls`; a vehicle that `rests` stays until they carry it."""
        self._sent = deque([ActuatorCommand(0, controls, armed=any(controls))])
        self._known: _Known | None = None
        self._rests = rests
        self._disturbance = np.zeros(6)

    def sent(self, command: ActuatorCommand) -> None:
        """Take in a command that is sent."""
        sent = self._sent
        if command.controls == sent[-1].controls and command.armed == sent[-1].armed:
            return
        sent.append(command)
        while sent[1].time_us < command.time_us - MAX_DELAY_US - _CONTINUES_US:
            sent.popleft()

    def ahead(self, frame: StateFrame, charge_ah: float, *, standing: bool = False) -> StateFrame:
        """Return the state `delay_us` after that of a frame; at zero the frame itself. Called once a control sample."""
        if self.delay_us == 0:
            self._known = None
            return frame
        battery = self._vehicle.battery
        voltage_v = 1.0 if battery is None else open_voltage_v(battery, charge_ah)
        x = self._now(frame, voltage_v)
        self._known = _Known(frame.time_us, x)
        self._rests = standing or (self._rests and motion.thrust_n(x[motion.ROTORS], self._model) < self._weight_n)
        if self._rests:
            self._disturbance = np.zeros(6)
            return frame
        return _frame(frame.time_us + self.delay_us, self._carried(x, frame.time_us, self.delay_us, voltage_v))

    @property
    def _weight_n(self) -> float:
        return self._vehicle.body.mass_kg * self._vehicle.gravity_m_s2

    def _choose(self) -> None:
        delay_us = self._median_us if self._declared_s is None else round(self._declared_s * 1e6)
        self.delay_us = min(max(delay_us, 0), MAX_DELAY_US)

    def _now(self, frame: StateFrame, voltage_v: float) -> Array:
        """Return x at a frame, the rotors as the commands that have acted turn them; observe what the model missed."""
        now_us, known = frame.time_us, self._known
        x = np.array(
            (
                *frame.position_enu_m,
                *frame.velocity_enu_m_s,
                *frame.attitude,
                *frame.rate_flu_rad_s,
                *self._speeds(self._acting(now_us)[0]),
            )
        )
        if known is None or not 0 < now_us - known.time_us <= _CONTINUES_US:
            self._disturbance = np.zeros(6)
            return x
        passed_us = now_us - known.time_us
        expected = self._carried(known.x, known.time_us, passed_us, voltage_v)
        x[motion.ROTORS] = expected[motion.ROTORS]
        missed = (x - expected)[[3, 4, 5, 10, 11, 12]] / (passed_us * 1e-6)
        part = 1.0 - exp(-_DISTURBANCE_RAD_S * passed_us * 1e-6)
        self._disturbance = np.clip(self._disturbance + part * missed, -_MAX_DISTURBANCE, _MAX_DISTURBANCE)
        return x

    def _carried(self, x: Array, from_us: int, duration_us: int, voltage_v: float) -> Array:
        """Return x after a duration, by the commands that take effect until then."""
        acting = self._acting(from_us, from_us + duration_us)
        begins = [from_us, *(it.time_us + self.delay_us for it in acting[1:]), from_us + duration_us]
        durations_s = np.diff(np.array(begins)) * 1e-6
        speeds = np.array([self._speeds(it) for it in acting])
        return motion.carry(x, durations_s, speeds, self._disturbance, voltage_v, self._model)

    def _acting(self, from_us: int, until_us: int = 0) -> list[ActuatorCommand]:
        """Return the command that acts at a time, and those that take effect until another."""
        acting = [self._sent[0]]
        for it in self._sent:
            acts_us = it.time_us + self.delay_us
            if acts_us <= from_us:
                acting = [it]
            elif acts_us < until_us:
                acting.append(it)
        return acting

    def _speeds(self, command: ActuatorCommand) -> FourRotors:
        """Return the rotor speeds that a command means: at least idle while armed, none while not."""
        if not command.armed:
            return NO_ROTORS
        rotors = self._vehicle.rotors
        a, b, c, d = (max(control * rotors.max_speed, rotors.idle_speed) for control in command.controls)
        return (a, b, c, d)


def _frame(time_us: int, x: Array) -> StateFrame:
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, p, q, r, *_ = x.tolist()
    return StateFrame(time_us, (px, py, pz), (vx, vy, vz), (qw, qx, qy, qz), (p, q, r))
