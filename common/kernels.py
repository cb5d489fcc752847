"""The functions of `elementary`, compiled, for other kernels and for Python."""

from types import FunctionType

from numba.extending import register_jitable

from colibri.common import elementary
from colibri.common.jit import compiled_for

for _function in vars(elementary).values():
    if isinstance(_function, FunctionType):
        register_jitable(_function)

_of_one, _of_two = compiled_for("float64(float64)"), compiled_for("float64(float64, float64)")

sin, cos, tan = _of_one(elementary.sin), _of_one(elementary.cos), _of_one(elementary.tan)
asin, acos, atan = _of_one(elementary.asin), _of_one(elementary.acos), _of_one(elementary.atan)
atan2, power = _of_two(elementary.atan2), _of_two(elementary.power)
exp, expm1, log = _of_one(elementary.exp), _of_one(elementary.expm1), _of_one(elementary.log)
