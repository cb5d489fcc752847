"""Rotor commands of one vehicle: of the control law within its solve time, or of the landing on three rotors."""

from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.registry import check_rotor_speeds
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.core.defence.descent import Descent
from colibri.autopilot.core.defence.plain_law import PlainLaw
from colibri.autopilot.guidance.guidance import RESTS, Guidance
from colibri.common.types import PerRotor
from colibri.plant.vehicle.description import Rotors, Vehicle


class SolveTime:
    """Simulates a slow control law: a decision takes effect a declared time after its sample.

    Until then the last command is held, and due samples are skipped. The same declared time gives the same flight.

    Attributes:
        missed: Number of decisions that took longer than a control interval.
    """

    def __init__(self, interval_us: int, stopped: PerRotor) -> None:
        self._interval_us = interval_us
        self._ready_us: int | None = None
        self._next = self._now = stopped
        self.missed = 0

    def busy(self, now_us: int) -> bool:
        """Whether a decision of an earlier sample is still being made."""
        self.controls(now_us)
        return self._ready_us is not None

    def decided(self, controls: PerRotor, now_us: int, solve_us: int) -> None:
        """Set the command of the sample at `now_us`, in effect after `solve_us`."""
        if solve_us > self._interval_us:
            self.missed += 1
        self._next, self._ready_us = controls, now_us + solve_us

    def at_once(self, controls: PerRotor) -> None:
        """Set a command that needs no solving; a decision that is being made is dropped."""
        self._now, self._ready_us = controls, None

    def controls(self, now_us: int) -> PerRotor:
        if self._ready_us is not None and now_us >= self._ready_us:
            self._now, self._ready_us = self._next, None
        return self._now


class Actuation:
    """Commands the rotors of one vehicle.

    Attributes:
        sent: The last command, parts of the largest speed.
        decision: The present decision; None while the rotors stand or idle.
        solve_time_s: Time of the last QP.
        by_plain_law: Whether the plain law has replaced the control law.
        descent: The last resort, once needed.
    """

    def __init__(self, loop: ControlLoop, rotor_loss: RotorLoss) -> None:
        """Command by the control law of `loop`, and by `rotor_loss` once a rotor is lost."""
        self._loop, self._rotor_loss = loop, rotor_loss
        self._stopped = loop.vehicle.rotors.stopped
        self.adopt(loop.vehicle)
        self.by_plain_law = False
        self.descent: Descent | None = None
        self._solving = SolveTime(loop.control_interval_us, self._stopped)
        self.sent = self._stopped
        self.decision: Decision | None = None
        self.solve_time_s = 0.0

    @property
    def missed(self) -> int:
        """How many decisions took longer than a control interval."""
        return self._solving.missed

    def adopt(self, vehicle: Vehicle) -> None:
        """Have a plain law for other numbers of the vehicle."""
        self.plain = PlainLaw(vehicle, self._loop.control_interval_us * 1e-6)

    def begin(self, controls: PerRotor) -> None:
        """Begin with the rotors turning at `controls`."""
        self.sent = controls
        self._solving.at_once(controls)
        self._rotor_loss.begin(controls)

    def send(self, now_us: int) -> PerRotor:
        """Return the command to send at `now_us`."""
        self.sent = self._solving.controls(now_us)
        return self.sent

    def turning(self, now_us: int, *, armed: bool) -> PerRotor:
        """Return how the rotors turn at `now_us`, idling at the least while armed, parts of the largest speed."""
        rotors = self._loop.vehicle.rotors
        minimum = rotors.idle_speed / rotors.max_speed if armed else 0.0
        controls = self._solving.controls(now_us)
        return tuple([control if control > minimum else minimum for control in controls])

    def decide(
        self, now_us: int, state: VehicleState, guidance: Guidance, charge_ah: float, solve_time_s: float
    ) -> Decision | None:
        """Decide at a control sample; return None while the rotors stand or idle, or an earlier sample is being solved.

        `charge_ah` was taken from the battery; `solve_time_s` is the declared solve time of the control law.

        Raises:
            DecisionError: The decision is outside the limits of the rotors.
        """
        decision = self._decide(now_us, state, guidance, charge_ah, solve_time_s)
        if decision is not None or not self._solving.busy(now_us):
            self.decision = decision
        return decision

    def decide_plainly(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        """Decide a control sample by the plain law, or by the descent, which needs no `guidance`."""
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
    """Return the command of a decision of the plain law, parts of the largest speed.

    Raises:
        DecisionError: No rotor can follow it.
    """
    check_rotor_speeds("plain law", decision.rotor_speeds, rotors)
    return tuple((decision.rotor_speeds / rotors.max_speed).tolist())
