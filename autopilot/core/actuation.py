"""Rotor commands of one vehicle: of the control law within its solve time, or of the landing on three rotors."""

from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.registry import check_rotor_speeds
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.core.defence.plain_law import Descent, PlainLaw
from colibri.autopilot.guidance.guidance import RESTS, Guidance
from colibri.common.types import PerRotor
from colibri.plant.vehicle.description import Rotors, Vehicle


class SolveTime:
    """Simulates a slow control law: the last command holds, and due samples are skipped, until a decision is ready."""

    def __init__(self, interval_us: int, stopped: PerRotor) -> None:
        self._interval_us = interval_us
        self._ready_us: int | None = None
        self._next = self._now = stopped
        self.missed = 0  # decisions that took longer than a control interval

    def busy(self, now_us: int) -> bool:
        self.controls(now_us)
        return self._ready_us is not None

    def decided(self, controls: PerRotor, now_us: int, solve_us: int) -> None:
        if solve_us > self._interval_us:
            self.missed += 1
        self._next, self._ready_us = controls, now_us + solve_us

    def at_once(self, controls: PerRotor) -> None:
        """Replace a decision that is being made by a command that needs no solving."""
        self._now, self._ready_us = controls, None

    def controls(self, now_us: int) -> PerRotor:
        if self._ready_us is not None and now_us >= self._ready_us:
            self._now, self._ready_us = self._next, None
        return self._now


class Actuation:
    """Commands the rotors by the control law, or by the landing on three rotors once one is lost."""

    def __init__(self, loop: ControlLoop, rotor_loss: RotorLoss) -> None:
        self._loop, self._rotor_loss = loop, rotor_loss
        self._stopped = loop.vehicle.rotors.stopped
        self.adopt(loop.vehicle)
        self.by_plain_law = False  # whether the plain law has replaced the control law
        self.descent: Descent | None = None  # the last resort, once needed
        self._solving = SolveTime(loop.control_interval_us, self._stopped)
        self.sent = self._stopped  # the last command, parts of the largest speed
        self.decision: Decision | None = None  # None while the rotors stand or idle
        self.solve_time_s = 0.0  # time of the last QP

    @property
    def missed(self) -> int:
        return self._solving.missed

    def adopt(self, vehicle: Vehicle) -> None:
        self.plain = PlainLaw(vehicle, self._loop.control_interval_us * 1e-6)

    def begin(self, controls: PerRotor) -> None:
        self.sent = controls
        self._solving.at_once(controls)
        self._rotor_loss.begin(controls)

    def send(self, now_us: int) -> PerRotor:
        self.sent = self._solving.controls(now_us)
        return self.sent

    def turning(self, now_us: int, *, armed: bool) -> PerRotor:
        """Return the speeds of the rotors, at least idle while armed, in parts of the largest."""
        rotors = self._loop.vehicle.rotors
        minimum = rotors.idle_speed / rotors.max_speed if armed else 0.0
        controls = self._solving.controls(now_us)
        return tuple([control if control > minimum else minimum for control in controls])

    def decide(
        self, now_us: int, state: VehicleState, guidance: Guidance, charge_ah: float, solve_time_s: float
    ) -> Decision | None:
        """Return the decision of a sample; None while the rotors stand or idle, or an earlier one is being solved."""
        decision = self._decide(now_us, state, guidance, charge_ah, solve_time_s)
        if decision is not None or not self._solving.busy(now_us):
            self.decision = decision
        return decision

    def decide_plainly(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        """Decide by the plain law, or by the descent, which needs no `guidance`."""
        if self.descent is not None:
            self.decision = self.descent.step(self.plain, now_us, state)
        elif guidance.horizon is not None:
            self.decision = self.plain.step(state, guidance.horizon)
        elif guidance.attitude is not None:
            self.decision = self.plain.step_attitude(state, guidance.attitude)
        else:
            self.decision = None
        decision, rotors = self.decision, self._loop.vehicle.rotors
        self._solving.at_once(self._stopped if decision is None else controls_of(decision, rotors))
        return self.decision

    def _decide(
        self, now_us: int, state: VehicleState, guidance: Guidance, charge_ah: float, solve_time_s: float
    ) -> Decision | None:
        loop = self._loop
        if self._rotor_loss.flies:
            controls, decision = self._rotor_loss.decide(state, charge_ah)
            self._solving.at_once(controls)
            return decision
        if guidance.begins:
            loop.begin(loop.vehicle.rotors.idle_speed, state.euler[2], afresh=False)
        elif guidance is not RESTS and self._solving.busy(now_us):
            return None
        if guidance.horizon is not None:
            decision = loop.decide(now_us, state, guidance.horizon, guidance.pace)
        elif guidance.attitude is not None:
            decision = loop.decide_attitude(now_us, state, guidance.attitude)
        else:
            self._solving.at_once(self._stopped)
            return None
        self._solving.decided(loop.controls, now_us, round(solve_time_s * 1e6))
        self.solve_time_s = decision.diagnostics.solve_time_s
        return decision


def controls_of(decision: Decision, rotors: Rotors) -> PerRotor:
    """Return the command of the plain law, parts of the largest speed; DecisionError if no rotor can follow it."""
    check_rotor_speeds("plain law", decision.rotor_speeds, rotors)
    return tuple((decision.rotor_speeds / rotors.max_speed).tolist())
