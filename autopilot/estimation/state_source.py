"""The vehicle's state: from the simulator or by estimation."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.sensing.inertial import Expected
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import OWN_MESSAGES, FixType, Frame, GpsFix, SensorFrame
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import Vehicle, VehicleError

if TYPE_CHECKING:
    from colibri.autopilot.estimation.estimator import Estimator

NewEstimator: TypeAlias = Callable[[int], "Estimator"]  # creates an estimator for a frame interval in µs


def estimator_for(feedback: Feedback, vehicle: Vehicle, origin: Geodetic) -> NewEstimator | None:
    """Return the factory of estimators for sensor feedback, or raise VehicleError without sensors."""
    if feedback is Feedback.STATE:
        return None
    sensors = vehicle.sensors
    if sensors is None:
        raise VehicleError(f"{vehicle.name} has no sensors: choose one with a table sensors, or --feedback state")
    from colibri.autopilot.estimation.estimator import Estimator  # slow to load

    gravity_m_s2 = vehicle.gravity_m_s2
    return lambda interval_us: Estimator(sensors, gravity_m_s2, origin, interval_us)


_LATE_US = 1_000_000
_NO_FIX_AFTER_US = 500_000  # receivers of a few hertz are sometimes late


class StateSource:
    """Turns any frame into a state; `latest` holds sensors with their own message."""

    def __init__(self, estimator: NewEstimator | None, interval_us: int) -> None:
        self._interval_us = interval_us
        self._make = estimator
        self._estimating = None if estimator is None else estimator(interval_us)
        self._time_us: int | None = None
        self._given: StateFrame | None = None
        self.estimate: Estimate | None = None
        self.sensed: SensorFrame | None = None
        self.latest: dict[str, Any] = {}
        self._fix_us = 0

    @property
    def fix(self) -> GpsFix | None:
        fix: GpsFix | None = self.latest.get("gps")
        return fix

    @property
    def estimates(self) -> bool:
        return self._make is not None

    @property
    def rests(self) -> bool:
        return self.estimate is not None and self._estimating is not None and not self._estimating.caught

    def record(self) -> bytes:
        return b"" if self._estimating is None else self._estimating.record()

    def resume(self, record: bytes, time_us: int) -> bool:
        return self._estimating is not None and self._estimating.resume(record, time_us)

    def receive(self, frame: Frame) -> None:
        """Queue a frame for the estimator; time that restarts is a new flight."""
        if isinstance(frame, StateFrame):
            self._given = frame
            return
        self._given = None
        assert self._make is not None, "frames of sensors come only where there is an estimator"
        again = self._time_us is not None and (frame.time_us == 0 or frame.time_us < self._time_us - _LATE_US)
        if self._estimating is None or again:
            self._estimating, self.estimate = self._make(self._interval_us), None
        self._time_us, self.sensed = frame.time_us, frame
        if frame.gps is not None or frame.distance is not None:
            given = {row.field: getattr(frame, row.field) for row in OWN_MESSAGES}
            self.latest.update({field: value for field, value in given.items() if value is not None})
        if frame.gps is not None:
            self._fix_us = frame.time_us
        self._estimating.receive(frame)
        self.estimate = self._estimating.last

    def state(self) -> StateFrame | None:
        if self._given is not None:
            return self._given
        if self._estimating is not None:
            self.estimate = self._estimating.estimate()
        return None if self.estimate is None else self.estimate.frame

    @property
    def last(self) -> StateFrame | None:
        """Latest state, without processing the queued frame."""
        if self._given is not None:
            return self._given
        return None if self.estimate is None else self.estimate.frame

    def advance(self) -> None:
        if self._estimating is not None:
            self._estimating.advance()
            self.estimate = self._estimating.last

    def settle(self) -> None:
        if self._estimating is not None:
            self._estimating.settle()

    @property
    def shaken(self) -> bool:
        """Whether the model of the rotors may be needed soon in place of the gyroscope."""
        return self._estimating is not None and self._estimating.shaken

    def help_inertial(self, expected: Expected, *, armed: bool) -> None:
        """Replace failed inertial sensors by the model of the rotors; at rest, try them again."""
        if self._estimating is not None:
            self._estimating.expect(expected if armed else None)
            if not armed:
                self._estimating.trust_inertial()

    def has_gps(self, now_us: int) -> bool:
        """Whether there is a recent 3D fix; always with state feedback."""
        if self._make is None:
            return True
        fix = self.fix
        return fix is not None and fix.fix_type >= FixType.FIX_3D and now_us < self._fix_us + _NO_FIX_AFTER_US
