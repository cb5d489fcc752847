"""References and decision of a control sample; each has a replacement that flies where it raises."""

from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.core.defence import table
from colibri.autopilot.core.defence.plain_law import Descent
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.guidance.guidance import RESTS, Guidance
from colibri.autopilot.guidance.tasks.position import HoldTask
from colibri.common.rotations import euler_from_quaternion
from colibri.mavlink.hil.state import StateFrame


class Flying:
    def __init__(self, parts: Parts) -> None:
        self._parts, self._guard = parts, parts.defence.guard
        self._blind = False
        self._now_us = 0

    @property
    def armed(self) -> bool:
        descent = self._parts.actuation.descent
        return self._parts.pilot.state.armed and not (descent is not None and descent.landed)

    def go_blind(self) -> None:
        """Descend without an estimator: the position is unknown."""
        if not self._blind:
            self._blind = True
            self._parts.defence.off.add(table.ROTOR_WATCH)
            self._parts.pilot.save(Action.DESCEND)

    def rescue(self, known: StateFrame, now_us: int) -> Decision | None:
        """Fly the last resort after an exception in the sample itself."""
        self.descend(now_us)
        euler = euler_from_quaternion(known.attitude)
        state = VehicleState(known.position_enu_m, known.velocity_enu_m_s, known.attitude, euler, known.rate_flu_rad_s)
        actuation = self._parts.actuation
        return self._guard(table.PLAIN_LAW, actuation.decide_plainly, lambda: None, now_us, state, RESTS)

    def descend(self, now_us: int) -> None:
        """Begin the descent, which is permanent."""
        pilot, actuation = self._parts.pilot, self._parts.actuation
        if actuation.descent is None:
            actuation.descent = Descent(now_us, pilot.ground.height_m, standing=pilot.ground.standing)
            pilot.readiness.descends = True

    def guide(self, now_us: int, _state: VehicleState) -> Guidance:
        """Return the pilot's references; after an exception in the task those of hold, then none."""
        pilot, self._now_us = self._parts.pilot, now_us
        if self._parts.actuation.descent is not None:
            return RESTS
        if isinstance(pilot.task, HoldTask) or pilot.state.mode is Mode.LAND:
            return self._guard(table.GUIDANCE, pilot.step, self._last_resort)
        return self._guard(table.TASK, pilot.step, self._hold)

    def _hold(self) -> Guidance:
        if not self._parts.pilot.state.armed:
            return RESTS
        return self._guard(table.GUIDANCE, self._step_hold, self._last_resort)

    def _step_hold(self) -> Guidance:
        self._parts.pilot.save(Action.HOLD)
        return self._parts.pilot.step()

    def _last_resort(self) -> Guidance:
        if self._parts.pilot.state.armed:
            self.descend(self._now_us)
        return RESTS

    def decide(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        parts = self._parts
        if parts.actuation.descent is None and not parts.actuation.by_plain_law:
            decision = self._decide_by_law(now_us, state, guidance)
        else:
            decision = self._decide_plainly(now_us, state, guidance)
        if parts.rotor_loss.landed and parts.pilot.state.armed:
            parts.pilot.touch_down()
        return decision

    def _decide_by_law(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        parts = self._parts
        flown = table.THREE_ROTORS if parts.rotor_loss.flies else table.LAW

        def instead() -> Decision | None:
            if flown is table.THREE_ROTORS and flown not in parts.defence.off:
                return None
            parts.rotor_loss.end()
            parts.actuation.by_plain_law = True
            return self._decide_plainly(now_us, state, guidance)

        return self._guard(flown, self._by_law, instead, now_us, state, guidance)

    def _by_law(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        parts = self._parts
        felt = state if parts.pilot.ground.clear(state) else state._replace(airborne=False)
        solve_time_s = parts.pilot.behaviour.solve_time_s
        return parts.actuation.decide(now_us, felt, guidance, parts.battery.charge_ah, solve_time_s)

    def _decide_plainly(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        actuation, pilot = self._parts.actuation, self._parts.pilot

        decision = self._guard(table.PLAIN_LAW, actuation.decide_plainly, lambda: None, now_us, state, guidance)
        if actuation.descent is not None and actuation.descent.landed and pilot.state.armed:
            pilot.touch_down()
        return decision
