"""Types, arithmetic, geometry and process support for every package."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.common.config import SettingsError as SettingsError
    from colibri.common.config import Table as Table
    from colibri.common.config import read_settings as read_settings
    from colibri.common.earth.geodesy import Geodetic as Geodetic
    from colibri.common.earth.geodesy import enu_of as enu_of
    from colibri.common.earth.geodesy import geodetic_of as geodetic_of
    from colibri.common.errors import Error as Error
    from colibri.common.errors import InFlightError as InFlightError
    from colibri.common.jit import compiled as compiled
    from colibri.common.rotations import earth_from_body as earth_from_body
    from colibri.common.rotations import euler_from_quaternion as euler_from_quaternion
    from colibri.common.rotations import quaternion_from_euler as quaternion_from_euler
    from colibri.common.rotations import rotation_matrix as rotation_matrix
    from colibri.common.types import Address as Address
    from colibri.common.types import Array as Array
    from colibri.common.types import Matrix as Matrix
    from colibri.common.types import PerRotor as PerRotor
    from colibri.common.types import Quaternion as Quaternion
    from colibri.common.types import Vector as Vector
else:
    __getattr__, __dir__ = public(__name__)
