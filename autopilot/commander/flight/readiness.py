"""Readiness to arm: the arming checks and failures in flight."""

from collections.abc import Callable, Iterable

from colibri.autopilot.commander.rules.arming import ArmingInputs, refusals
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.mavlink.services.statustext import EMERGENCY


class Readiness:
    """Failures as texts, empty if none: `unsteady` while a failsafe lands, `descends` under the last-resort law."""

    def __init__(self, lines: StatusQueue) -> None:
        self._lines = lines
        self.inputs = ArmingInputs(None, standing=True, charge=1.0, thrust_stick=None)
        self.further: Callable[[], Iterable[str]] | None = None  # reasons of an identity's own checks
        self.rotor_failed = self.error = self.unsteady = ""
        self.descends = self._lands = False

    def refusals(self) -> list[str]:
        further = () if self.further is None else self.further()
        return [*refusals(self.inputs), *filter(None, (self.rotor_failed, self.error)), *further]

    @property
    def may_arm(self) -> bool:
        return not self.refusals()

    @property
    def only_lands(self) -> str:
        """Reason why only landing is possible."""
        return (self.rotor_failed if self._lands else "") or (self.error if self.descends else "") or self.unsteady

    def fail(self, error: str) -> None:
        self.error = self.error or error

    def lose_rotor(self, rotor: int, remaining: str = "three rotors", *, lands: bool = True) -> None:
        self.rotor_failed, self._lands = f"rotor {rotor + 1} failed", lands
        self._lines.say(EMERGENCY, f"{self.rotor_failed}: {'landing' if lands else 'flying'} on {remaining}")
