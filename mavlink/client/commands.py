"""Commands, repeated until acknowledged: https://mavlink.io/en/services/command.html."""

from collections.abc import Sequence
from typing import Any

from colibri.mavlink.client.conversation import USUALLY, Conversation, Encoded, Repeat, Target
from colibri.mavlink.services.command import IN_PROGRESS, NOT_GIVEN
from colibri.mavlink.wire.dialect import Message, definition_of, mav

PROGRESS_WITHIN_US = 3_000_000  # longest interval of progress reports before the command is repeated
_MAX_CONFIRMATION = 255
_PARAMS, _INT_PARAMS = 7, 4


class Command(Conversation):
    """A COMMAND_LONG; `result` is its MAV_RESULT."""

    answers = frozenset({"COMMAND_ACK"})

    def __init__(self, target: Target, number: int, *params: float, repeat: Repeat = USUALLY) -> None:
        super().__init__(target, ("command", number), repeat)
        self.number = number
        self.progress: int | None = None  # percent
        self._params = padded(params, _PARAMS)

    def _read(self, message: Message) -> None:
        fields = message.fields
        if fields.command != self.number:
            return
        if fields.result == IN_PROGRESS:
            self.progress = fields.progress
            self._wait(max(self._repeat.every_us, PROGRESS_WITHIN_US))
        else:
            self.result = fields.result

    def _request(self) -> Sequence[Encoded]:
        confirmation = min(self._sent - 1, _MAX_CONFIRMATION)
        return (("COMMAND_LONG", (*self.target, self.number, confirmation, *self._params)),)


class CommandInt(Command):
    """A COMMAND_INT; its place is in the units of the MAV_FRAME."""

    def __init__(
        self,
        target: Target,
        number: int,
        *params: float,
        frame: int,
        x: int = NOT_GIVEN,
        y: int = NOT_GIVEN,
        z: float = 0.0,
        repeat: Repeat = USUALLY,
    ) -> None:
        super().__init__(target, number, repeat=repeat)
        self._fields = (*target, frame, number, 0, 0, *padded(params, _INT_PARAMS), x, y, z)

    def _request(self) -> Sequence[Encoded]:
        return (("COMMAND_INT", self._fields),)


def set_message_interval(target: Target, name: str, interval_us: float, *, repeat: Repeat = USUALLY) -> Command:
    number = float(definition_of(name).id)
    return Command(target, mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_us, repeat=repeat)


def padded(params: Sequence[float], count: int) -> tuple[Any, ...]:
    return (*params, *(0.0,) * (count - len(params)))
