"""The supervisor: decides and reports failsafes."""

from colibri.autopilot.commander.rules.failsafe_conditions import Conditions, FailsafeInputs, position_known
from colibri.autopilot.commander.rules.failsafe_parameters import Limits, limits, settings
from colibri.autopilot.commander.rules.failsafe_rule import FailsafeMemory, FlightState, following
from colibri.autopilot.commander.rules.failsafe_table import Action, Condition
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.estimation.estimate import Estimate
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.wire.dialect import mav

_CHARGE_STATES: tuple[tuple[Condition, int], ...] = (
    (Condition.BATTERY_EMERGENCY, mav.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
    (Condition.BATTERY_CRITICAL, mav.MAV_BATTERY_CHARGE_STATE_CRITICAL),
    (Condition.BATTERY_LOW, mav.MAV_BATTERY_CHARGE_STATE_LOW),
)


class Supervisor:
    def __init__(self, parameters: Parameters, lines: StatusQueue) -> None:
        self._lines = lines
        self._conditions = Conditions()
        self.memory = FailsafeMemory()
        self.limits: Limits = {}
        self.adopt(parameters)

    def adopt(self, parameters: Parameters) -> None:
        self.limits, self._settings = limits(parameters), settings(parameters)

    def position_known(self, estimate: Estimate | None) -> bool:
        return position_known(estimate, self.limits)

    def step(self, inputs: FailsafeInputs, flight: FlightState) -> Action:
        """Return the action to begin, before the pilot's step."""
        since_us = self._conditions.look(inputs, self.limits, self.memory.held_us)
        self.memory, action, lines = following(
            self.memory, inputs.now_us, since_us, self._settings, flight, inputs.exempt
        )
        for severity, text in lines:
            self._lines.say(severity, text)
        return action

    def holds(self, condition: Condition) -> bool:
        """Whether a condition holds beyond its delay."""
        return condition in self.memory.held_us

    @property
    def charge_state(self) -> int:
        ok: int = mav.MAV_BATTERY_CHARGE_STATE_OK
        held = self.memory.held_us
        return next((state for condition, state in _CHARGE_STATES if condition in held), ok) if held else ok
