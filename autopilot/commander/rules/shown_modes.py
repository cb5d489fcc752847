"""Flight modes as clients see them.

PX4's `ModeBook` shows every mode of the vehicle as itself; another may show several as one, such as ArduPilot's GUIDED.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from colibri.autopilot.commander.rules.modes import MANUAL, MODES, Mode, State, custom_mode, mode_of, mode_of_custom
from colibri.mavlink.services.command import UNSUPPORTED
from colibri.mavlink.wire.dialect import Refusal, mav

CUSTOM: int = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
STABILIZED: int = CUSTOM | mav.MAV_MODE_FLAG_STABILIZE_ENABLED
_BY_STICKS: int = STABILIZED | mav.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
_AUTO: int = STABILIZED | mav.MAV_MODE_FLAG_AUTO_ENABLED | mav.MAV_MODE_FLAG_GUIDED_ENABLED


class ShownMode(NamedTuple):
    """A flight mode of an identity."""

    number: int  # HEARTBEAT.custom_mode
    name: str
    flies: Mode | None = None  # mode of the vehicle; None: the mode is refused by name
    covers: frozenset[Mode] = frozenset()  # modes of the vehicle shown as this one while it is selected
    to_arm: bool = True
    guided: bool = True  # whether the vehicle controls its position
    waits: bool = False  # whether a standing vehicle waits for a start
    standard: int = 0  # MAV_STANDARD_MODE or 0
    selectable: bool = True


BaseModes = tuple[int, int]
"""MAV_MODE_FLAG bits but the armed one: without sticks, and with them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeBook:
    """The flight modes of an identity.

    Attributes:
        by_command: Returns the number, and its text, by DO_SET_MODE's parameters 1 to 3.
    """

    modes: tuple[ShownMode, ...]
    first: int
    chosen: Mapping[Mode, int]  # number for a mode of the vehicle, by command or unselected
    saved: Mapping[Mode, int]  # number shown for a failsafe's mode
    resumed: Mapping[Mode, int]  # number shown where a flight begins in the air
    by_command: Callable[[float, float, float], tuple[int, str] | Refusal]
    by_message: Callable[[int, int], tuple[int, str] | Refusal]  # returns the same by SET_MODE's base and custom mode
    unknown: Callable[[str], Refusal]  # returns the refusal of a number by its text
    refusal: Callable[[ShownMode, Refusal], Refusal]
    unarmable: Callable[[ShownMode], Refusal]
    base_modes: Callable[[ShownMode, State, int], BaseModes]  # returns HEARTBEAT.base_mode; the number is of flights
    as_command: Callable[[int], tuple[float, float, float]]  # returns DO_SET_MODE's parameters 1 to 3
    destination: bool = False  # whether NAV_CONTROLLER_OUTPUT has the distance to where the vehicle goes
    takeoff: int | None = None  # mode that NAV_TAKEOFF requires, with arming; None: neither is required

    @property
    def numbers(self) -> dict[int, ShownMode]:
        return {mode.number: mode for mode in self.modes}


def _by_command(p1: float, p2: float, p3: float) -> tuple[int, str] | Refusal:
    numbers = (p1, p2, p3)
    if not all(0.0 <= number < 256.0 and number == int(number) for number in numbers):
        return Refusal("mode refused: {:g} {:g} {:g} is not a PX4 base, main and sub mode".format(*numbers))
    base, main, sub = map(int, numbers)
    if not base & CUSTOM:
        return Refusal(f"mode refused: base mode {base} has no custom mode", UNSUPPORTED)
    mode = mode_of(main, sub)
    return -1 if mode is None else custom_mode(mode), f"{main} {sub}"


def _by_message(base_mode: int, number: int) -> tuple[int, str]:
    mode = mode_of_custom(number) if base_mode & CUSTOM else None
    return -1 if mode is None else custom_mode(mode), f"{base_mode} {number}"


def _base_modes(shown: ShownMode, _state: State, _flights: int) -> BaseModes:
    return _AUTO, _BY_STICKS if shown.flies in MANUAL else _AUTO


PX4_MODES = ModeBook(
    modes=tuple(
        ShownMode(
            custom_mode(row.mode),
            row.mode.title(),
            row.mode,
            frozenset((row.mode,)),
            standard=row.standard,
            selectable=row.selectable,
        )
        for row in MODES
    ),
    first=custom_mode(Mode.HOLD),
    chosen={mode: custom_mode(mode) for mode in Mode},
    saved={mode: custom_mode(mode) for mode in Mode},
    resumed={mode: custom_mode(mode) for mode in Mode},
    by_command=_by_command,
    by_message=_by_message,
    unknown=lambda said: Refusal(f"mode refused: {said} is no mode of this vehicle", UNSUPPORTED),
    refusal=lambda _, refusal: refusal,
    unarmable=lambda mode: Refusal(f"Arming denied in {mode.name}: choose another mode first"),
    base_modes=_base_modes,
    as_command=lambda number: (float(CUSTOM), float(number >> 16 & 0xFF), float(number >> 24 & 0xFF)),
)
