"""The supervisor: has the pilot do what the failsafes' table says, and tells what the ground station is to know."""

from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.failsafe_conditions import Conditions, Seen, knows_position
from colibri.autopilot.commander.rules.failsafe_parameters import Limits, limits, settings
from colibri.autopilot.commander.rules.failsafe_rule import Flight, Memory, following
from colibri.autopilot.commander.rules.failsafe_table import Action, Condition
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.wire.dialect import mav

_CHARGE_STATES: tuple[tuple[Condition, int], ...] = (
    (Condition.BATTERY_EMERGENCY, mav.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
    (Condition.BATTERY_CRITICAL, mav.MAV_BATTERY_CHARGE_STATE_CRITICAL),
    (Condition.BATTERY_LOW, mav.MAV_BATTERY_CHARGE_STATE_LOW),
)


class Supervisor:
    """Supervises one pilot.

    Attributes:
        limits: What the parameters say of limits and delays.
        knows_position: Whether the vehicle knows where it is.
        memory: What is lost already; after a restart in flight it is what was kept.
    """

    def __init__(self, pilot: Pilot, parameters: Parameters) -> None:
        """Begin with nothing lost."""
        self._pilot = pilot
        self._conditions = Conditions()
        self.memory = Memory()
        self.limits: Limits = {}
        self.knows_position = True
        self.adopt(parameters)

    def adopt(self, parameters: Parameters) -> None:
        """Go by the parameters as they are now."""
        self.limits, self._settings = limits(parameters), settings(parameters)

    def step(self, seen: Seen) -> None:
        """Do what is to be done at this control sample, before the pilot's step."""
        pilot = self._pilot
        self.knows_position = knows_position(seen.estimate, self.limits)
        flight = Flight(pilot.state.armed, pilot.standing, pilot.state.mode, pilot.saving)
        since_us = self._conditions.look(seen, self.limits, self.memory.held_us)
        self.memory, action, said = following(self.memory, seen.now_us, since_us, self._settings, flight)
        for severity, text in said:
            pilot.say(severity, text)
        if action is not Action.NONE:
            pilot.save(action)

    def holds(self, condition: Condition) -> bool:
        """Whether a condition holds, beyond its delay."""
        return condition in self.memory.held_us

    @property
    def charge_state(self) -> int:
        """MAV_BATTERY_CHARGE_STATE, as the failsafes take it."""
        ok: int = mav.MAV_BATTERY_CHARGE_STATE_OK
        return next((state for condition, state in _CHARGE_STATES if self.holds(condition)), ok)
