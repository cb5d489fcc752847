"""PX4's layout of modes, main << 16 | sub << 24, which Colibri shares."""

from colibri.companion.stacks.stack import ModeNumber

_CUSTOM = 1.0
_AUTO, _OFFBOARD = 4, 6


def _mode(name: str, main: int, sub: int = 0) -> ModeNumber:
    return ModeNumber(name, main << 16 | sub << 24, (_CUSTOM, float(main), float(sub)))


OFFBOARD = _mode("OFFBOARD", _OFFBOARD)
HOLD = _mode("HOLD", _AUTO, 3)
LAND = _mode("LAND", _AUTO, 6)
TAKEOFF = _mode("TAKEOFF", _AUTO, 2)
STEADY = frozenset({HOLD.custom, TAKEOFF.custom})
