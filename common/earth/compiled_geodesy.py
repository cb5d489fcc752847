"""The conversions of `geodesy`, compiled; the same bits."""

from functools import partial

from colibri.common import kernels
from colibri.common.earth import geodesy
from colibri.common.jit import compiled_for

__all__ = ["enu_of", "geodetic_of", "kernels"]

_PAIR, _FLOATS = "UniTuple(float64, 2)", ", ".join(["float64"] * 4)

enu_of = partial(geodesy.enu_of, offset=compiled_for(f"{_PAIR}({_FLOATS})")(geodesy.offset_m))
geodetic_of = partial(geodesy.geodetic_of, place=compiled_for(f"{_PAIR}({_FLOATS}, float64)")(geodesy.place_deg))
