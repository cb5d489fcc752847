"""Flight tests in pytest: a vehicle, its plant, its ground stations and the links between, in simulated time."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.sitl.backends.link_faults import SessionError as SessionError
    from colibri.sitl.backends.setting import Setting as Setting
    from colibri.sitl.backends.setting import SettingError as SettingError
    from colibri.sitl.errors import SitlError as SitlError
    from colibri.sitl.flight_record import Record as Record
    from colibri.sitl.ground_station import RefusedError as RefusedError
    from colibri.sitl.ground_station import Station as Station
    from colibri.sitl.session import Fleet as Fleet
    from colibri.sitl.session import Flights as Flights
    from colibri.sitl.stepping import NotInTimeError as NotInTimeError
    from colibri.sitl.vehicle import Sitl as Sitl
else:
    __getattr__, __dir__ = public(__name__)
