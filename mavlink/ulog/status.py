"""The vehicle's status as a topic, with PX4's mode numbers."""

from typing import NamedTuple

from colibri.mavlink.ulog import messages, topics
from colibri.mavlink.ulog.flight_topics import ROTORS
from colibri.mavlink.ulog.topics import record
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, vehicle_type

_DISARMED, _ARMED = 1, 2
_ROTARY_WING = 1
_NAV_STATES = {
    (7, 0): 15,
    (2, 0): 1,
    (3, 0): 2,
    (3, 1): 21,
    (6, 0): 14,
    (4, 2): 17,
    (4, 3): 4,
    (4, 4): 3,
    (4, 5): 5,
    (4, 6): 18,
    (4, 8): 19,
    (4, 11): 23,
}
"""PX4's main mode and sub mode -> its nav_state; 23, EXTERNAL1, flies a track."""


class VehicleStatus(NamedTuple):
    armed: bool
    custom_mode: int  # in PX4's layout
    failsafe: bool = False
    armable: bool = True
    armed_us: int = 0  # last arming; 0 before
    takeoff_us: int = 0  # last take-off; 0 before


def nav_state(custom_mode: int) -> int:
    return _NAV_STATES.get((custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF), 31)


def status_message(time_us: int, status: VehicleStatus, system_id: int, rotors: int = ROTORS) -> bytes:
    mode = nav_state(status.custom_mode)
    who = (_ROTARY_WING, vehicle_type(rotors), system_id, AUTOPILOT_COMPONENT)
    times_us, arming = (time_us, status.armed_us, status.takeoff_us), _ARMED if status.armed else _DISARMED
    return messages.SYNC + record(
        *(topics.STATUS, *times_us, arming, mode, mode, *who), status.failsafe, False, False, status.armable
    )
