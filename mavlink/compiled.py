"""The rotations of `frames`, compiled: for kernels, and for whoever turns attitudes many times a second."""

from common import kernels
from common.jit import compiled
from mavlink import frames

__all__ = ["euler_from_quaternion", "euler_rates", "kernels", "quaternion_from_euler", "rotation_matrix"]

rotation_matrix = compiled(frames.rotation_matrix)
euler_from_quaternion = compiled(frames.euler_from_quaternion)
euler_rates = compiled(frames.euler_rates)
quaternion_from_euler = compiled(frames.quaternion_from_euler)
