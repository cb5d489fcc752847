"""Flight modes of PX4 (shared by Colibri) and ArduPilot's copters."""

from typing import NamedTuple

from colibri.mavlink.wire.dialect import mav

PX4: int = mav.MAV_AUTOPILOT_PX4
ARDUPILOT: int = mav.MAV_AUTOPILOT_ARDUPILOTMEGA
_CUSTOM = float(mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)


class FlightMode(NamedTuple):
    name: str
    custom: int  # `custom_mode` of HEARTBEAT
    command: tuple[float, float, float]  # MAV_CMD_DO_SET_MODE's parameters 1 to 3


def _px4(name: str, main: int, sub: int = 0) -> FlightMode:
    return FlightMode(name, main << 16 | sub << 24, (_CUSTOM, float(main), float(sub)))


def _copter(name: str, number: int) -> FlightMode:
    return FlightMode(name, number, (_CUSTOM, float(number), 0.0))


def _named(*modes: FlightMode) -> dict[str, FlightMode]:
    return {mode.name: mode for mode in modes}


PX4_MODES = _named(
    _px4("Manual", 1),
    _px4("Altitude", 2),
    _px4("Position", 3),
    _px4("Takeoff", 4, 2),
    _px4("Hold", 4, 3),
    _px4("Mission", 4, 4),
    _px4("Return", 4, 5),
    _px4("Land", 4, 6),
    _px4("Follow target", 4, 8),
    _px4("Acro", 5),
    _px4("Offboard", 6),
    _px4("Stabilized", 7),
    _px4("Orbit", 3, 1),
)
"""https://docs.px4.io/main/en/flight_modes/."""
COPTER_MODES = _named(
    _copter("Stabilize", 0),
    _copter("Acro", 1),
    _copter("Alt Hold", 2),
    _copter("Auto", 3),
    _copter("Guided", 4),
    _copter("Loiter", 5),
    _copter("RTL", 6),
    _copter("Circle", 7),
    _copter("Land", 9),
    _copter("PosHold", 16),
    _copter("Brake", 17),
    _copter("Smart RTL", 21),
)
"""https://ardupilot.org/copter/docs/parameters.html, FLTMODE1."""
MODES: dict[int, dict[str, FlightMode]] = {PX4: PX4_MODES, ARDUPILOT: COPTER_MODES}  # by MAV_AUTOPILOT and name


def mode_named(autopilot: int | None, name: str) -> FlightMode | None:
    return MODES.get(autopilot or 0, {}).get(name)


def mode_name(autopilot: int, custom_mode: int) -> str:
    names = (mode.name for mode in MODES.get(autopilot, {}).values() if mode.custom == custom_mode)
    return next(names, f"mode {custom_mode}")
