"""What every package may use; nothing of a vehicle or of MAVLink."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.common.config import SettingsError, Table, read_settings
    from colibri.common.earth.geodesy import Geodetic, enu_of, geodetic_of
    from colibri.common.errors import Error, InFlightError
    from colibri.common.jit import compiled
    from colibri.common.rotations import earth_from_body, euler_from_quaternion, quaternion_from_euler, rotation_matrix
    from colibri.common.types import Address, Array, FourRotors, Matrix, Quaternion, Vector
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.common.config": "SettingsError Table read_settings",
            "colibri.common.earth.geodesy": "Geodetic enu_of geodetic_of",
            "colibri.common.errors": "Error InFlightError",
            "colibri.common.jit": "compiled",
            "colibri.common.rotations": "earth_from_body euler_from_quaternion quaternion_from_euler rotation_matrix",
            "colibri.common.types": "Address Array FourRotors Matrix Quaternion Vector",
        },
    )

__all__ = [
    "Address",
    "Array",
    "Error",
    "FourRotors",
    "Geodetic",
    "InFlightError",
    "Matrix",
    "Quaternion",
    "SettingsError",
    "Table",
    "Vector",
    "compiled",
    "earth_from_body",
    "enu_of",
    "euler_from_quaternion",
    "geodetic_of",
    "quaternion_from_euler",
    "read_settings",
    "rotation_matrix",
]
