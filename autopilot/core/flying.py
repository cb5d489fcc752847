"""A control sample flown: supervision, guidance, actuation; what raises is replaced."""

from colibri.autopilot.commander.flight.reference_generator import RESTS, Guidance
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.core.defence import errors
from colibri.autopilot.core.defence.descent import Descent
from colibri.autopilot.core.defence.errors import Defence
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.core.supervision import Supervision
from colibri.autopilot.guidance.tasks.position import HoldTask
from colibri.common.rotations import euler_from_quaternion
from colibri.mavlink.hil.state import StateFrame


class Flying:
    """Flies one vehicle, control sample after control sample."""

    def __init__(self, parts: Parts, supervision: Supervision, defence: Defence) -> None:
        """Fly a vehicle of these parts."""
        self._parts, self._supervision, self._defence = parts, supervision, defence
        self._blind = False

    @property
    def armed(self) -> bool:
        """Whether the rotors may turn."""
        descent = self._parts.actuation.descent
        return self._parts.pilot.state.armed and not (descent is not None and descent.landed)

    def step(self, now_us: int, state: VehicleState, *, blind: bool) -> tuple[Guidance, Decision | None]:
        """Fly a sample; `blind`: the estimator has failed, and nobody knows the place."""
        parts = self._parts
        if blind and not self._blind:
            self._blind = True
            self._defence.off.add(errors.ROTOR_WATCH)
            parts.pilot.save(Action.DESCEND)
        self._supervision.step(now_us, state)
        guidance = RESTS if parts.actuation.descent is not None else self._guided(now_us)
        decision = self._decided(now_us, state, guidance)
        if parts.rotor_loss.landed and parts.pilot.state.armed:
            parts.pilot.touch_down()
        return guidance, decision

    def rescue(self, now_us: int, known: StateFrame) -> Decision | None:
        """Fly the last resort where a sample itself has raised."""
        self.descend(now_us)
        euler = euler_from_quaternion(known.attitude)
        state = VehicleState(known.position_enu_m, known.velocity_enu_m_s, known.attitude, euler, known.rate_flu_rad_s)
        try:
            return self._parts.actuation.decide_plainly(now_us, state, RESTS)
        except Exception as error:
            self._defence.caught(errors.PLAIN_LAW, error)
            return None

    def descend(self, now_us: int) -> None:
        """Fly the last resort from now on, for good."""
        pilot, actuation = self._parts.pilot, self._parts.actuation
        if actuation.descent is None:
            actuation.descent = Descent(now_us, pilot.ground.height_m, standing=pilot.ground.standing)
            pilot.readiness.descends = True

    def _guided(self, now_us: int) -> Guidance:
        """Return the pilot's references; where his task raises, those of hold, and where that does, none."""
        pilot, defence = self._parts.pilot, self._defence
        holds = not isinstance(pilot.task, HoldTask) and pilot.state.mode is not Mode.LAND
        try:
            return pilot.step()
        except Exception as error:
            defence.caught(errors.TASK if holds else errors.GUIDANCE, error)
        if not pilot.state.armed:
            return RESTS
        if holds:
            try:
                pilot.save(Action.HOLD)
                return pilot.step()
            except Exception as error:
                defence.caught(errors.GUIDANCE, error)
        self.descend(now_us)
        return RESTS

    def _decided(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        """Return the decision of the control law, or of what flies in its place."""
        parts, actuation, defence = self._parts, self._parts.actuation, self._defence
        if actuation.descent is None and not actuation.by_plain_law:
            flown = errors.THREE_ROTORS if parts.rotor_loss.flies else errors.LAW
            try:
                solve_time_s = parts.pilot.behaviour.solve_time_s
                felt = state if parts.pilot.ground.clear(state) else state._replace(airborne=False)
                return actuation.decide(now_us, felt, guidance, parts.battery.charge_ah, solve_time_s)
            except Exception as error:
                defence.caught(flown, error)
            if flown is errors.THREE_ROTORS and flown not in defence.off:
                return None
            parts.rotor_loss.end()
            actuation.by_plain_law = True
        try:
            decision = actuation.decide_plainly(now_us, state, guidance)
        except Exception as error:
            defence.caught(errors.PLAIN_LAW, error)
            return None
        if actuation.descent is not None and actuation.descent.landed and parts.pilot.state.armed:
            parts.pilot.touch_down()
        return decision
