"""Flight tests in pytest: a vehicle, its plant, its ground stations and the links between, all in simulated time."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.sitl.backends.lockstep import SessionError
    from colibri.sitl.backends.setting import Setting, SettingError
    from colibri.sitl.errors import SitlError
    from colibri.sitl.fleet import Fleet
    from colibri.sitl.flight_record import Record
    from colibri.sitl.ground_station import RefusedError, Station
    from colibri.sitl.session import Flights
    from colibri.sitl.stepping import NotInTimeError
    from colibri.sitl.vehicle import Sitl
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.sitl.backends.setting": "Setting SettingError",
            "colibri.sitl.backends.lockstep": "SessionError",
            "colibri.sitl.errors": "SitlError",
            "colibri.sitl.fleet": "Fleet",
            "colibri.sitl.flight_record": "Record",
            "colibri.sitl.ground_station": "RefusedError Station",
            "colibri.sitl.session": "Flights",
            "colibri.sitl.stepping": "NotInTimeError",
            "colibri.sitl.vehicle": "Sitl",
        },
    )

__all__ = [
    "Fleet",
    "Flights",
    "NotInTimeError",
    "Record",
    "RefusedError",
    "SessionError",
    "Setting",
    "SettingError",
    "Sitl",
    "SitlError",
    "Station",
]
