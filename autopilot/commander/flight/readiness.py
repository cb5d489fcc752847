"""Readiness of the vehicle: the arming checks, and a failed rotor that rules out everything but landing."""

from colibri.autopilot.commander.rules.arming import ArmingInputs, refusals
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.mavlink.services.statustext import EMERGENCY


class Readiness:
    """Readiness of one vehicle to fly.

    Attributes:
        rotor_failed: The failed rotor in words; empty if none has failed.
    """

    def __init__(self, lines: StatusQueue) -> None:
        """Begin before the first arming inputs; a failed rotor is reported to `lines`."""
        self._lines = lines
        self._inputs = ArmingInputs(None, standing=True, charge=1.0, thrust_stick=None)
        self.rotor_failed = ""

    def update(self, inputs: ArmingInputs) -> None:
        """Set the inputs of the arming checks."""
        self._inputs = inputs

    def refusals(self) -> list[str]:
        """Return why the rotors may not be armed; empty if they may."""
        return refusals(self._inputs) + ([self.rotor_failed] if self.rotor_failed else [])

    def lose_rotor(self, rotor: int) -> None:
        """Mark rotor 0..3 as failed: no mode can be selected any more, and its failsafe lands."""
        self.rotor_failed = f"rotor {rotor + 1} failed"
        self._lines.say(EMERGENCY, f"{self.rotor_failed}: landing on three rotors")

    def trust_rotors(self) -> None:
        """Mark all rotors as sound again."""
        self.rotor_failed = ""
