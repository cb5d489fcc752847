"""Type aliases shared by all packages."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]  # w, x, y, z
Matrix: TypeAlias = tuple[Vector, Vector, Vector]
PerRotor: TypeAlias = tuple[float, ...]  # one number per rotor, 3 to 8
Address: TypeAlias = tuple[str, int]  # host and port
