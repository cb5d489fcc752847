"""Readiness of the vehicle: the arming checks, and a failed rotor that rules out everything but landing."""

from colibri.autopilot.commander.rules.arming import ArmingInputs, refusals
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.mavlink.services.statustext import EMERGENCY


class Readiness:
    """Readiness of one vehicle to fly.

    Attributes:
        rotor_failed: The failed rotor in words; empty if none has failed.
        error: The part that has raised an exception in flight, in words; empty if none has.
        descends: Whether the last resort is flown: nothing but its landing is possible.
    """

    def __init__(self, lines: StatusQueue) -> None:
        self._lines = lines
        self._inputs = ArmingInputs(None, standing=True, charge=1.0, thrust_stick=None)
        self.rotor_failed = self.error = ""
        self.descends = False

    def update(self, inputs: ArmingInputs) -> None:
        """Set the inputs of the arming checks."""
        self._inputs = inputs

    def refusals(self) -> list[str]:
        """Return why the rotors may not be armed; empty if they may."""
        return [*refusals(self._inputs), *filter(None, (self.rotor_failed, self.error))]

    @property
    def may_arm(self) -> bool:
        """Whether the rotors may be armed: nothing refuses it."""
        return not (self.rotor_failed or self.error) and next(refusals(self._inputs), None) is None

    @property
    def only_lands(self) -> str:
        """Why nothing but a landing is possible any more; empty if more is."""
        return self.rotor_failed or (self.error if self.descends else "")

    def fail(self, error: str) -> None:
        """Mark a part as failed: the rotors are not armed again."""
        self.error = self.error or error

    def lose_rotor(self, rotor: int) -> None:
        """Mark rotor 0..3 as failed: no mode can be selected any more, and its failsafe lands."""
        self.rotor_failed = f"rotor {rotor + 1} failed"
        self._lines.say(EMERGENCY, f"{self.rotor_failed}: landing on three rotors")

    def trust_rotors(self) -> None:
        """Mark all rotors as sound again."""
        self.rotor_failed = ""
