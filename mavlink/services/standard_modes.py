"""The standard modes microservice: mavlink.io/en/services/standard_modes.html. CURRENT_MODE is telemetry."""

from collections.abc import Callable, Sequence
from math import isnan
from typing import NamedTuple, TypeAlias

from colibri.mavlink.node.service import Fields, Send, to
from colibri.mavlink.services.command import FAILED, Handler, ReceivedCommand
from colibri.mavlink.wire.dialect import Refusal, mav

NAME_BYTES = 34  # of AVAILABLE_MODES.mode_name without its final zero


class ModeInfo(NamedTuple):
    """A flight mode, as listed for ground stations."""

    name: str
    custom_mode: int  # as in HEARTBEAT
    standard_mode: int = 0  # MAV_STANDARD_MODE or 0
    selectable: bool = True
    advanced: bool = False  # "harder to fly"


SetMode: TypeAlias = Callable[[int, ReceivedCommand], Refusal | None]  # takes a custom mode


class StandardModes:
    """Lists the modes, and sets the standard ones."""

    def __init__(self, modes: Sequence[ModeInfo], set_mode: SetMode) -> None:
        self._modes = tuple(modes)
        self._set_mode = set_mode

    def handlers(self) -> dict[int, Handler]:
        return {mav.MAV_CMD_DO_SET_STANDARD_MODE: self._set_standard_mode}

    def available_modes(self, command: ReceivedCommand) -> list[Send] | Refusal:
        """Answer REQUEST_MESSAGE of AVAILABLE_MODES: param2 is an index from 1, or 0 for all modes."""
        index = 0.0 if isnan(command.p2) else command.p2
        numbers = range(1, len(self._modes) + 1)
        if index == 0.0:
            return [to(command.peer, "AVAILABLE_MODES", *self._fields(number)) for number in numbers]
        if index not in numbers:
            return Refusal(f"AVAILABLE_MODES: index {index:g} is not within 0 to {len(self._modes)}")
        return [to(command.peer, "AVAILABLE_MODES", *self._fields(int(index)))]

    def monitor(self, command: ReceivedCommand) -> list[Send]:
        return [to(command.peer, "AVAILABLE_MODES_MONITOR", 0)]

    def _fields(self, index: int) -> Fields:
        mode = self._modes[index - 1]
        properties = 0 if mode.selectable else mav.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE
        properties |= mav.MAV_MODE_PROPERTY_ADVANCED if mode.advanced else 0
        name = mode.name.encode()[:NAME_BYTES]
        return (len(self._modes), index, mode.standard_mode, mode.custom_mode, properties, name)

    def _set_standard_mode(self, command: ReceivedCommand) -> Refusal | None:
        for mode in self._modes:
            if mode.standard_mode == command.p1 and mode.standard_mode and mode.selectable:
                return self._set_mode(mode.custom_mode, command)
        return Refusal(f"standard mode {command.p1:g} is no mode of this vehicle", FAILED)
