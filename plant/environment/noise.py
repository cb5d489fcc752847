"""White noise on the body and on the rotors' commands; it depends on seed and time alone."""

from collections.abc import Mapping

import numpy as np

from colibri.common.types import PerRotor, Vector
from colibri.plant.environment.random_streams import RandomStream

_ROTORS = 8  # the most of a vehicle
NOISES = ("force", "moment", "motors")  # N, N m, and parts of each rotor's command, for each root of hertz


class Noise:
    """Process and motor noise, held over each frame: a density d has the standard deviation d / √(frame's duration)."""

    def __init__(self, densities: Mapping[str, float], seed: int) -> None:
        force, moment, motors = (densities.get(name, 0.0) for name in NOISES)
        self._densities = np.array([force] * 3 + [moment] * 3 + [motors] * _ROTORS)
        self._key = np.random.SeedSequence(seed, spawn_key=(RandomStream.NOISE,)).generate_state(2, np.uint64)

    def over(self, time_us: int, duration_us: int) -> tuple[Vector, Vector, PerRotor]:
        """Return force, N, and moment, N m, on the body, FLU, and factors of 8 rotors' commands, from `time_us` on."""
        chance = np.random.Generator(np.random.Philox(key=self._key, counter=time_us << 64))
        normal = chance.standard_normal(len(self._densities)).astype(np.float32)  # as in `random_streams.Chance`
        fx, fy, fz, mx, my, mz, *motors = (self._densities * normal / (duration_us * 1e-6) ** 0.5).tolist()
        return (fx, fy, fz), (mx, my, mz), tuple([1.0 + part for part in motors])
