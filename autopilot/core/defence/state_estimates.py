"""The state of each frame: from the estimator, or after its exception from the inertial sensors."""

from colibri.autopilot.core.defence import table
from colibri.autopilot.core.defence.errors import Defence
from colibri.autopilot.core.defence.inertial_estimate import InertialEstimate
from colibri.autopilot.estimation.state_source import StateSource
from colibri.mavlink.hil.sensors import Frame, SensorFrame
from colibri.mavlink.hil.state import StateFrame

_BRIDGED = 5  # frames in a row after which the position counts as unknown
_MAX_ERRORS = 50  # exceptions after which the estimator is not asked again
_UNKNOWN_M = 1e3


class StateEstimates:
    def __init__(self, source: StateSource, defence: Defence, gravity_m_s2: float) -> None:
        self._source, self._defence, self._gravity = source, defence, gravity_m_s2
        self._inertial: InertialEstimate | None = None
        self._missed = 0
        self.blind = False  # whether the state comes from the inertial sensors alone, without position

    def state(self, frame: Frame, *, now: bool) -> StateFrame | None:
        """Return the state at a frame, or with `now` false at the frame before; None before the first estimate."""
        guard, source = self._defence.guard, self._source
        if not self.blind:
            worked, known = guard(table.ESTIMATOR, self._estimated, lambda: (False, None), frame, now)
            if worked:
                self._inertial, self._missed = None, 0
                return known
        if isinstance(frame, StateFrame):
            return frame
        last = None if source.estimate is None else source.estimate.frame
        return guard(table.STANDBY, lambda: self._carry_on(frame), lambda: last)

    def _estimated(self, frame: Frame, now: bool) -> tuple[bool, StateFrame | None]:
        """Run all work of the estimator for a frame, so that its exceptions belong to this frame."""
        self._source.receive(frame)
        self._source.advance()
        return True, self._source.state() if now else self._source.last

    def _carry_on(self, frame: SensorFrame) -> StateFrame | None:
        estimate, self._source.sensed = self._source.estimate, frame
        if estimate is None:
            return None
        self._missed += 1
        if self._inertial is None:
            self._inertial = InertialEstimate(estimate, self._gravity)
        known = self._inertial.step(frame)
        estimate = estimate._replace(frame=known, check=None)
        self.blind |= self._missed > _BRIDGED or self._defence.counts[table.ESTIMATOR] > _MAX_ERRORS
        if self.blind:
            (_, _, height_m), (_, _, climb_m_s) = estimate.position_std_m, estimate.velocity_std_m_s
            health = estimate.health._replace(
                horizontal_position=False,
                horizontal_velocity=False,
                dead_reckoning=True,
                gps_lost_since_us=known.time_us,
            )
            estimate = estimate._replace(
                position_std_m=(_UNKNOWN_M, _UNKNOWN_M, height_m),
                velocity_std_m_s=(_UNKNOWN_M, _UNKNOWN_M, climb_m_s),
                health=health,
            )
        self._source.estimate = estimate
        return known
