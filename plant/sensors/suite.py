"""The sensors of the plant: truth in, what each sensor makes of it out.

What they measure depends on the seed, the simulated time and the truth alone: each has a stream of chance of its own,
and the same frame asked for twice is the same frame.
"""

from collections.abc import Callable
from typing import TypeAlias

from colibri.common.earth.atmosphere import pressure_pa, temperature_c
from colibri.common.earth.geodesy import Geodetic
from colibri.common.earth.magnetic_field import field_enu_gauss
from colibri.common.rotations import earth_from_body
from colibri.common.types import Vector
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import Frame, SensorFrame, Updated
from colibri.plant.environment.random_streams import Source, streams
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.world import Physics, World, state_frame
from colibri.plant.sensors.errors import GaussMarkov, accelerometer, gyroscope
from colibri.plant.sensors.faults import SensorFaults
from colibri.plant.sensors.gps import GpsReceiver
from colibri.plant.vehicle.description import Vehicle
from colibri.plant.vehicle.sensors import Barometer, Magnetometer, Sensors

Tell: TypeAlias = Callable[[World], Frame]
"""What the plant tells the autopilot of a world."""

_ROUNDING = 1e-9
_INERTIAL = Updated.ACCELEROMETER | Updated.GYROSCOPE


def tells(
    feedback: Feedback,
    vehicle: Vehicle,
    physics: Physics,
    origin: Geodetic,
    *,
    seed: int,
    interval_us: int,
    faults: SensorFaults | None = None,
) -> Tell:
    """Return what makes of each world, in order, the frame that the autopilot is told; `faults` may change it."""
    if feedback is Feedback.STATE:
        return state_frame
    assert vehicle.sensors is not None, "only what has sensors serves them"
    return SensorSuite(vehicle.sensors, physics, origin, seed=seed, interval_us=interval_us, faults=faults).measure


def served_by(vehicle: Vehicle) -> list[Feedback]:
    """Return the feedback that a vehicle can give."""
    return [Feedback.STATE] if vehicle.sensors is None else list(Feedback)


class Rate:
    """Samples at the first frame at or after each multiple of its interval."""

    def __init__(self, rate_hz: float) -> None:
        """Be due first at the first frame."""
        self._rate_mhz = rate_hz * 1e-6
        self._samples = -1

    def is_due(self, time_us: int) -> bool:
        """Whether there is a sample at this frame; to be asked once a frame."""
        samples = int(time_us * self._rate_mhz + _ROUNDING)
        due = samples > self._samples
        self._samples = samples
        return due


class SensorSuite:
    """All sensors of one vehicle."""

    def __init__(
        self,
        parts: Sensors,
        physics: Physics,
        origin: Geodetic,
        *,
        seed: int,
        interval_us: int,
        faults: SensorFaults | None = None,
    ) -> None:
        """Switch them on.

        Args:
            parts: What they are.
            physics: Of the world that they measure.
            origin: Of the ENU frame.
            seed: Of their chance, not negative.
            interval_us: Between two frames.
            faults: What frames go through; None where nothing can fail.
        """
        self._faults = faults
        accelerating, turning, magnetic, pressing, placing = streams(seed, Source.SENSORS, 5)
        self._specific_force = physics.specific_force
        self._origin = origin
        self._accelerometer = accelerometer(parts.accelerometer, interval_us * 1e-6, accelerating)
        self._gyroscope = gyroscope(parts.gyroscope, interval_us * 1e-6, turning)
        self._field_gauss = field_enu_gauss(origin)
        self._magnetometer: Magnetometer = parts.magnetometer
        self._magnetic = magnetic
        iron = parts.magnetometer.hard_iron_gauss
        self._iron_gauss = (iron * next(magnetic), iron * next(magnetic), iron * next(magnetic))
        self._magnetometer_rate = Rate(parts.magnetometer.rate_hz)
        self._magnetic_gauss: Vector = (0.0, 0.0, 0.0)
        self._barometer: Barometer = parts.barometer
        self._pressing = pressing
        self._pressure_drift = GaussMarkov(parts.barometer.drift_pa, parts.barometer.drift_time_s, pressing)
        self._barometer_rate = Rate(parts.barometer.rate_hz)
        self._pressed_us: int | None = None
        self._pressure_pa = 0.0
        self._gps = GpsReceiver(parts.gps, origin, placing)
        self._gps_rate = Rate(parts.gps.rate_hz)
        self._frame: SensorFrame | None = None

    def measure(self, world: World) -> SensorFrame:
        """Return what they tell of `world`; each frame is the next one, or the one before again."""
        if self._frame is None or self._frame.time_us != world.time_us:
            frame = self._measured(world)
            self._frame = frame if self._faults is None else self._faults.through(frame)
        return self._frame

    def _measured(self, world: World) -> SensorFrame:
        now_us = world.time_us
        u, v, w, p, q, r, x, y, z = world.state[:9]
        updated = _INERTIAL
        if self._magnetometer_rate.is_due(now_us):
            updated |= Updated.MAGNETOMETER
            self._magnetic_gauss = self._magnetic_field(world)
        if self._barometer_rate.is_due(now_us):
            updated |= Updated.BAROMETER
            self._pressure_pa = self._pressure(now_us, z)
        if self._gps_rate.is_due(now_us):
            self._gps.measure(now_us, (x, y, z), earth_from_body(attitude_of(world.state), (u, v, w)))
        return SensorFrame(
            now_us,
            updated,
            self._accelerometer.measure(self._specific_force(world)),
            self._gyroscope.measure((p, q, r)),
            self._magnetic_gauss,
            self._pressure_pa,
            temperature_c(self._origin.altitude_m + z),
            self._gps.tell(now_us),
        )

    def _magnetic_field(self, world: World) -> Vector:
        qw, qx, qy, qz = attitude_of(world.state)
        x, y, z = earth_from_body((qw, -qx, -qy, -qz), self._field_gauss)
        iron, noise, chance = self._iron_gauss, self._magnetometer.noise_gauss, self._magnetic
        return (
            x + iron[0] + noise * next(chance),
            y + iron[1] + noise * next(chance),
            z + iron[2] + noise * next(chance),
        )

    def _pressure(self, now_us: int, height_m: float) -> float:
        if self._pressed_us is not None:
            self._pressure_drift.after((now_us - self._pressed_us) * 1e-6)
        self._pressed_us = now_us
        noise_pa = self._barometer.noise_pa * next(self._pressing)
        return pressure_pa(self._origin.altitude_m + height_m) + self._pressure_drift.value + noise_pa
