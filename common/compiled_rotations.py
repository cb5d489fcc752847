"""The functions of `rotations`, compiled, for kernels and frequent calls."""

from colibri.common import kernels, rotations
from colibri.common.jit import compiled, compiled_for

__all__ = ["euler_from_quaternion", "euler_rates", "kernels", "quaternion_from_euler", "rotation_matrix"]

_VECTOR, _QUATERNION = "UniTuple(float64, 3)", "UniTuple(float64, 4)"

rotation_matrix = compiled(rotations.rotation_matrix)
euler_from_quaternion = compiled_for(f"{_VECTOR}({_QUATERNION})")(rotations.euler_from_quaternion)
euler_rates = compiled_for(f"{_VECTOR}(float64, float64, {_VECTOR})")(rotations.euler_rates)
quaternion_from_euler = compiled_for(f"{_QUATERNION}(float64, float64, float64)")(rotations.quaternion_from_euler)
