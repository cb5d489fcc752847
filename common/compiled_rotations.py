"""The functions of `rotations`, compiled, for kernels and frequent calls."""

from numba.extending import register_jitable

from colibri.common import kernels, rotations  # noqa: F401 - the first compiles the second's sines
from colibri.common.jit import compiled, compiled_for

VECTOR, QUATERNION = "UniTuple(float64, 3)", "UniTuple(float64, 4)"

register_jitable(rotations.rotation_matrix)
rotation_matrix = compiled(rotations.rotation_matrix)
earth_from_body = compiled_for(f"{VECTOR}({QUATERNION}, {VECTOR})")(rotations.earth_from_body)
quaternion_product = compiled(rotations.quaternion_product)
euler_from_quaternion = compiled_for(f"{VECTOR}({QUATERNION})")(rotations.euler_from_quaternion)
euler_rates = compiled_for(f"{VECTOR}(float64, float64, {VECTOR})")(rotations.euler_rates)
quaternion_from_euler = compiled_for(f"{QUATERNION}(float64, float64, float64)")(rotations.quaternion_from_euler)
