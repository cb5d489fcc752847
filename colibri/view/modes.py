"""Modes of PX4 (and so of Colibri) and of ArduPilot's copters: their words, and their numbers on the wire."""

from colibri.mavlink.wire.dialect import mav

PX4: int = mav.MAV_AUTOPILOT_PX4
ARDUPILOT: int = mav.MAV_AUTOPILOT_ARDUPILOTMEGA

_PX4_MODES: dict[str, tuple[int, int]] = {
    "Manual": (1, 0),
    "Altitude": (2, 0),
    "Position": (3, 0),
    "Takeoff": (4, 2),
    "Hold": (4, 3),
    "Mission": (4, 4),
    "Return": (4, 5),
    "Land": (4, 6),
    "Follow target": (4, 8),
    "Acro": (5, 0),
    "Offboard": (6, 0),
    "Stabilized": (7, 0),
    "Orbit": (3, 1),
}
"""Main and sub mode, https://docs.px4.io/main/en/flight_modes/."""
_ARDUPILOT_MODES: dict[str, int] = {
    "Stabilize": 0,
    "Acro": 1,
    "Alt Hold": 2,
    "Auto": 3,
    "Guided": 4,
    "Loiter": 5,
    "RTL": 6,
    "Circle": 7,
    "Land": 9,
    "PosHold": 16,
    "Brake": 17,
    "Smart RTL": 21,
}
"""https://ardupilot.org/copter/docs/parameters.html, FLTMODE1."""
CHOICES: dict[int, tuple[str, ...]] = {
    PX4: ("Hold", "Position", "Altitude", "Mission", "Return", "Land"),
    ARDUPILOT: ("Guided", "Loiter", "Alt Hold", "Auto", "Brake", "RTL", "Land"),
}
"""What the page offers, by MAV_AUTOPILOT."""


def mode_name(autopilot: int, custom_mode: int) -> str:
    """Return the word for a heartbeat's mode; its number where that is unknown."""
    if autopilot == PX4:
        found = (custom_mode >> 16 & 0xFF, custom_mode >> 24)
        return next((name for name, codes in _PX4_MODES.items() if codes == found), f"mode {custom_mode}")
    if autopilot == ARDUPILOT:
        return next((name for name, code in _ARDUPILOT_MODES.items() if code == custom_mode), f"mode {custom_mode}")
    return f"mode {custom_mode}"


def set_mode(autopilot: int | None, name: str) -> tuple[float, float, float] | None:
    """Return the parameters of MAV_CMD_DO_SET_MODE for a mode; None where this autopilot's are not known."""
    custom = float(mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
    if autopilot == PX4 and name in _PX4_MODES:
        main, sub = _PX4_MODES[name]
        return custom, float(main), float(sub)
    if autopilot == ARDUPILOT and name in _ARDUPILOT_MODES:
        return custom, float(_ARDUPILOT_MODES[name]), 0.0
    return None
