"""MAV_CMD_INJECT_FAILURE, forwarded to the plant and acknowledged with its result."""

from colibri.mavlink.hil.faults import MOTORS, Equipment, Fault, fault_from, judged
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import FaultResult
from colibri.mavlink.hil.world_changes import WorldChange
from colibri.mavlink.services.command import FAILED, PENDING, UNSUPPORTED, ReceivedCommand
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_DENIED, Refusal

ANSWERED_WITHIN_US = 1_000_000  # the result is normally in the frame after next


class Failures:
    """Forwards faults to the plant, and its results back."""

    def __init__(self, feedback: Feedback, *, relays: bool, motors: int = MOTORS) -> None:
        self._relays, self._motors = relays, motors
        self._parts = [part for part in Equipment if part is not Equipment.SENSORS or feedback is Feedback.SENSORS]
        self._to_send: list[Fault | WorldChange] = []
        self._pending: tuple[Fault, ReceivedCommand] | None = None

    def inject(self, command: ReceivedCommand, *, enabled: bool) -> Refusal | None:
        if not enabled:
            return Refusal("failure refused: parameter SYS_FAILURE_EN is 0")
        fault = fault_from(command.p1, command.p2, command.p3, (command.p4, command.x, command.y, command.z))
        if fault is None:
            return Refusal("failure refused: unit, type and instance must be whole numbers")
        refusal = self.request(fault)
        if refusal is not None:
            return Refusal(f"failure refused: {refusal.reason}", refusal.result)
        self._pending = (fault, command)
        return PENDING

    def request(self, asked: Fault | WorldChange) -> Refusal | None:
        """Have the plant change without an answer."""
        if not self._relays:
            return Refusal("this simulator does not change", UNSUPPORTED)
        judgement = judged(asked, self._parts, self._motors) if isinstance(asked, Fault) else asked
        if isinstance(judgement, Refusal):
            return judgement
        self._to_send.append(judgement)
        return None

    def take(self) -> tuple[Fault | WorldChange, ...]:
        if not self._to_send:
            return ()
        faults, self._to_send = tuple(self._to_send), []
        return faults

    def poll(self, results: tuple[FaultResult, ...], now_us: int) -> tuple[ReceivedCommand, Refusal | None] | None:
        if self._pending is None:
            return None
        fault, command = self._pending
        for reported in results:
            if (reported.unit, reported.kind) == (fault.unit, fault.kind):
                self._pending = None
                return command, _outcome(reported.result)
        if not 0 <= now_us - command.now_us < ANSWERED_WITHIN_US:
            self._pending = None
            return command, Refusal("failure refused: the plant does not answer", FAILED)
        return None


def _outcome(result: int) -> Refusal | None:
    if result == RESULT_ACCEPTED:
        return None
    why = "impossible numbers" if result == RESULT_DENIED else "no such part"
    return Refusal(f"failure refused by the plant: {why}", result)
