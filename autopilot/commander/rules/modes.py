"""Flight modes as two tables; source of `docs/modes.md`. Custom modes are PX4's: main << 16 | sub << 24."""

from collections.abc import Collection, Mapping
from enum import Enum, StrEnum
from typing import NamedTuple

from colibri.mavlink.wire.dialect import Refusal, mav


class Mode(StrEnum):
    STABILIZED = "stabilized"
    ALTITUDE = "altitude"
    POSITION = "position"
    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    RETURN = "return"
    MISSION = "mission"
    OFFBOARD = "offboard"
    ORBIT = "orbit"
    FOLLOW = "follow"
    TRACK = "track"


class Need(Enum):
    """A need; its value is the reason of a refusal."""

    ATTITUDE_CONTROL = "the control law takes no attitude setpoints"
    STICKS = "no MANUAL_CONTROL received"
    SETPOINTS = "no offboard setpoints received: send them before the mode"
    MISSION = "there is no mission"
    WITHIN_REACH = "the mission leads too far away"
    INSIDE_FENCE = "the mission leads outside the geofence"
    ABOVE_GROUND = "the mission leads below the ground"
    CHECKED = "the mission is being compared with the geofence: try again"
    CIRCLE = "send DO_ORBIT first"
    POSITION = "the position is not known"
    FLYING = "the vehicle is not flying"


class Event(StrEnum):
    """Events that change the mode or the arming."""

    SELECT = "selected"
    ARM = "armed"
    DISARM = "disarmed"
    ARRIVED = "take-off height reached"
    FINISHED = "finished"
    RETURN_ITEM = "return item reached"
    SAVED_BY_HOLD = "failsafe: hold"
    SAVED_BY_RETURN = "failsafe: return"
    SAVED_BY_LANDING = "failsafe: land"
    TERMINATED = "failsafe: terminate"
    TOUCHED_DOWN = "landed"
    LEFT_STANDING = "no take-off"


STANDARD_MODES: Mapping[Mode, int] = {
    Mode.ALTITUDE: mav.MAV_STANDARD_MODE_ALTITUDE_HOLD,
    Mode.POSITION: mav.MAV_STANDARD_MODE_POSITION_HOLD,
    Mode.TAKEOFF: mav.MAV_STANDARD_MODE_TAKEOFF,
    Mode.LAND: mav.MAV_STANDARD_MODE_LAND,
    Mode.RETURN: mav.MAV_STANDARD_MODE_SAFE_RECOVERY,
    Mode.MISSION: mav.MAV_STANDARD_MODE_MISSION,
    Mode.ORBIT: mav.MAV_STANDARD_MODE_ORBIT,
}


class ModeRow(NamedTuple):
    """A mode with PX4's numbers and its needs in flight."""

    mode: Mode
    main: int
    sub: int
    needs: tuple[Need, ...]
    meaning: str
    to_arm: bool = True
    selectable: bool = True

    @property
    def standard(self) -> int:
        """MAV_STANDARD_MODE or 0."""
        return STANDARD_MODES.get(self.mode, 0)


AUTO = 4
_TILT = (Need.ATTITUDE_CONTROL, Need.STICKS)
_PLACE = (Need.POSITION,)
_PLAN = (Need.MISSION, Need.WITHIN_REACH, Need.INSIDE_FENCE, Need.ABOVE_GROUND, Need.POSITION)
_CIRCLE = (Need.FLYING, Need.CIRCLE, Need.POSITION)
_HOMEWARD = "climbs, flies to the nearest of home and rally points, and lands"

MODES: tuple[ModeRow, ...] = (
    ModeRow(Mode.STABILIZED, 7, 0, _TILT, "sticks to tilt, yaw rate and thrust"),
    ModeRow(Mode.ALTITUDE, 2, 0, _TILT, "sticks to tilt, yaw rate and climb rate; holds height"),
    ModeRow(Mode.POSITION, 3, 0, (Need.STICKS, Need.POSITION), "sticks to velocity; holds position"),
    ModeRow(Mode.HOLD, AUTO, 3, _PLACE, "stops (if low and fast, at 1 m) and holds; flies to reposition commands"),
    ModeRow(Mode.TAKEOFF, AUTO, 2, _PLACE, "climbs to the take-off height"),
    ModeRow(Mode.LAND, AUTO, 6, (), "descends here, then disarms; level without position", to_arm=False),
    ModeRow(Mode.RETURN, AUTO, 5, _PLACE, _HOMEWARD, to_arm=False),
    ModeRow(Mode.MISSION, AUTO, 4, _PLAN, "flies the uploaded mission"),
    ModeRow(Mode.OFFBOARD, 6, 0, (Need.SETPOINTS,), "follows the setpoints of a companion"),
    ModeRow(Mode.ORBIT, 3, 1, _CIRCLE, "flies around a centre", to_arm=False, selectable=False),
    ModeRow(Mode.FOLLOW, AUTO, 8, (Need.FLYING, Need.POSITION), "follows the target of FOLLOW_TARGET", to_arm=False),
    ModeRow(Mode.TRACK, AUTO, 11, _PLACE, "flies the track of parameter TRACK"),
)
ROWS = {row.mode: row for row in MODES}


class Transition(NamedTuple):
    """From `sources`, or any if empty, to `target`; None: the selected or the present mode."""

    sources: tuple[Mode, ...]
    event: Event
    armed: bool
    target: Mode | None
    disarms: bool = False


MANUAL = (Mode.STABILIZED, Mode.ALTITUDE, Mode.POSITION)
TRANSITIONS: tuple[Transition, ...] = (
    Transition((), Event.SELECT, armed=False, target=None),
    Transition((), Event.ARM, armed=False, target=None),
    Transition((Mode.LAND, Mode.RETURN, Mode.ORBIT, Mode.FOLLOW), Event.DISARM, True, Mode.HOLD, disarms=True),
    Transition((), Event.DISARM, armed=True, target=None, disarms=True),
    Transition((), Event.TOUCHED_DOWN, armed=True, target=Mode.HOLD, disarms=True),
    Transition((), Event.LEFT_STANDING, armed=True, target=Mode.HOLD, disarms=True),
    Transition((Mode.TAKEOFF,), Event.ARRIVED, armed=True, target=Mode.HOLD),
    Transition((Mode.MISSION, Mode.TRACK), Event.FINISHED, armed=True, target=Mode.HOLD),
    Transition((Mode.MISSION,), Event.RETURN_ITEM, armed=True, target=Mode.RETURN),
    Transition((), Event.SAVED_BY_HOLD, armed=True, target=Mode.HOLD),
    Transition((), Event.SAVED_BY_RETURN, armed=True, target=Mode.RETURN),
    Transition((), Event.SAVED_BY_LANDING, armed=True, target=Mode.LAND),
    Transition((), Event.TERMINATED, armed=True, target=Mode.HOLD, disarms=True),
)


class State(NamedTuple):
    """The flight mode, and whether the rotors may turn."""

    mode: Mode
    armed: bool


FIRST = State(Mode.HOLD, armed=False)


def next_state(state: State, event: Event, selected: Mode | None, missing: Mapping[Need, str]) -> State | Refusal:
    for row in TRANSITIONS:
        if row.event is event and (not row.sources or state.mode in row.sources) and (state.armed or not row.armed):
            break
    else:
        return Refusal(f"'{event}' has no effect in {state.mode}")
    mode = row.target or selected or state.mode
    if event is Event.SELECT and (state.armed or not ROWS[mode].selectable):
        need = first_missing(mode, missing)
        if need is not None:
            return Refusal(f"{mode} refused: {missing[need]}")
    if event is Event.ARM:
        need = first_missing(mode, missing)
        if need is not None or not ROWS[mode].to_arm:
            return Refusal(f"Arming denied in {mode}: {missing[need] if need else 'choose another mode first'}")
    armed = event is Event.ARM or (state.armed and not row.disarms)
    return State(mode, armed)


def first_missing(mode: Mode, missing: Collection[Need]) -> Need | None:
    return next((need for need in ROWS[mode].needs if need in missing), None)


_NUMBERS = {row.mode: row.main << 16 | row.sub << 24 for row in MODES}
_BY_NUMBER = {number: mode for mode, number in _NUMBERS.items()}
_ALIASES = {(1, 0): Mode.STABILIZED}  # PX4's manual mode flies a multicopter like stabilized


def mode_of(main: int, sub: int) -> Mode | None:
    return _BY_NUMBER.get(main << 16 | sub << 24, _ALIASES.get((main, sub)))


def custom_mode(mode: Mode) -> int:
    return _NUMBERS[mode]


def mode_of_custom(number: int) -> Mode | None:
    return mode_of(number >> 16 & 0xFF, number >> 24 & 0xFF) if number & 0xFFFF == 0 else None
