"""Flight tasks by attitude and thrust."""

import numpy as np

from colibri.autopilot.guidance.attitude_reference import STICK_MIDDLE, AttitudeReference, ReferenceMemory, tilt_command
from colibri.autopilot.guidance.attitude_slew import AttitudeCommand
from colibri.autopilot.guidance.landing_detector import CARRIED, is_below
from colibri.autopilot.guidance.reference import BindingDerivative, Reference, Target, lead, moving_with, still_target
from colibri.autopilot.guidance.tasks.position import HoldTask, sinking_m_s
from colibri.autopilot.guidance.tasks.sticks import kept, stick_climb, without_play
from colibri.autopilot.guidance.tasks.task import AttitudeMotion, EndlessTask, PositionMotion, TaskContext, lifts
from colibri.common.kernels import cos
from colibri.mavlink.setpoints.setpoints import Sticks

_LIFTING, _SINKING = 0.9, 0.5  # thrust relative to weight: take-off above, certain sinking below
_HEIGHT_1_S2, _CLIMB_1_S, _INTEGRAL_1_S3 = 9.0, 6.0, 4.0
"""Poles of the height loop near -3 and -2, 1/s; the integral compensates a wrong mass or a weak battery."""
_MAX_LIFT_M_S2, _MAX_OFFSET_M_S2 = 6.0, 4.0
_MIN_UPRIGHT = 0.5
_RESTS_M_S = 0.025
_WRONG_BELOW_M, _TWICE_M, _FASTEST_M_S = 3.0, 10.0, 2.0  # margin under the ground; twice as fast 10 m farther; limit


class TiltLoop:
    def __init__(self, generator: AttitudeReference) -> None:
        self.generator = generator
        self._memory: ReferenceMemory | None = None

    def forget(self) -> None:
        self._memory = None

    def by_command(self, command: AttitudeCommand, context: TaskContext) -> AttitudeMotion:
        if self._memory is None:
            self._memory = self.generator.initial(context.state)
        self._memory, demand = self.generator.step(self._memory, context.state, command)
        # of a thrust of nan both are False: a vehicle that stands stays, one that flies does not sink
        share = command.thrust_n / self.generator.weight_n
        return AttitudeMotion(demand, moving_with(context.state), lifts=share > _LIFTING, sinks=share < _SINKING)


class StabilizedTask(EndlessTask):
    """Sticks to tilt, yaw rate and thrust."""

    def __init__(self, generator: AttitudeReference) -> None:
        self._tilt = TiltLoop(generator)
        self._stop = HoldTask()

    def update(self, context: TaskContext) -> PositionMotion | AttitudeMotion:
        sticks = context.steered.sticks
        if sticks is None:
            return self._stop.update(context)
        generator, hover = self._tilt.generator, context.behaviour.hover_throttle
        command = generator.from_sticks(without_play(sticks))
        if hover:
            thrust_n = generator.weight_n * copter_throttle(sticks.thrust, hover) / hover
            command = command._replace(thrust_n=min(thrust_n, generator.max_thrust_n))
        return self._tilt.by_command(command, context)


def copter_throttle(stick: float, hover: float) -> float:
    """Return ArduCopter's throttle, 0..1, which is `hover` at half the stick: Mode::get_pilot_desired_throttle."""
    bend = min(max((STICK_MIDDLE - hover) / 0.375, -0.5), 1.0)
    return stick * (1.0 - bend + bend * stick * stick)


class AltitudeTask(EndlessTask):
    """Sticks to tilt, yaw rate and climb, with height hold."""

    def __init__(self, generator: AttitudeReference, gravity_m_s2: float) -> None:
        self._tilt = TiltLoop(generator)
        self._stop = HoldTask()
        self._loop = HeightLoop(generator.weight_n, gravity_m_s2)
        self._height_m: float | None = None

    def update(self, context: TaskContext) -> PositionMotion | AttitudeMotion:
        sticks = context.steered.sticks
        if sticks is None:
            return self._stop.update(context)
        reference, lifting = self._climb(sticks, context)
        command = self._tilt.generator.from_sticks(without_play(sticks))._replace(
            thrust_n=self._loop.thrust_n(reference, context)
        )
        motion = self._tilt.by_command(command, context)
        return motion._replace(reference=reference, lifts=lifting, sinks=is_below(reference.height_m, context.state))

    def _climb(self, sticks: Sticks, context: TaskContext) -> tuple[Reference, bool]:
        climb_m_s = stick_climb(sticks, context)
        rests = abs(context.velocity[2]) < _RESTS_M_S
        self._height_m = kept(self._height_m, context.place[2], climb_m_s == 0.0, rests)
        reference, target = vertically(context, climb_m_s, self._height_m)
        return reference, lifts(target, context.state)


class DescentTask(EndlessTask):
    """Level descent without position or heading.

    An estimate below the ground is wrong: the vehicle sinks more slowly than estimated, or not at all. It then descends
    faster.
    """

    def __init__(self, generator: AttitudeReference, gravity_m_s2: float) -> None:
        self._tilt = TiltLoop(generator)
        self._weight_n = generator.weight_n
        self._loop = HeightLoop(self._weight_n, gravity_m_s2)

    def update(self, context: TaskContext) -> AttitudeMotion:
        under_m = max(context.ground_m - _WRONG_BELOW_M - context.place[2], 0.0)
        slow_m_s = sinking_m_s(context)
        speed_m_s = max(min(slow_m_s * (1.0 + under_m / _TWICE_M), _FASTEST_M_S), slow_m_s)
        reference, _ = vertically(context, -speed_m_s, None)
        thrust_n = self._loop.thrust_n(reference, context)
        motion = self._tilt.by_command(tilt_command(0.0, 0.0, 0.0, thrust_n), context)
        sinks = thrust_n < CARRIED * self._weight_n
        return motion._replace(reference=reference, lifts=False, sinks=sinks, drifts=True)


class HeightLoop:
    def __init__(self, weight_n: float, gravity_m_s2: float) -> None:
        self._weight_n, self._gravity_m_s2 = weight_n, gravity_m_s2
        self._offset_m_s2 = 0.0

    def thrust_n(self, reference: Reference, context: TaskContext) -> float:
        """Return the thrust, N, to the height of `reference`."""
        height_m, climb_m_s, lift_m_s2 = (float(order) for order in reference.motion[:3, 2])
        state = context.state
        height_error, climb_error = height_m - state.position_enu_m[2], climb_m_s - state.velocity_enu_m_s[2]
        self._offset_m_s2 += _INTEGRAL_1_S3 * height_error * context.interval_s
        self._offset_m_s2 = min(max(self._offset_m_s2, -_MAX_OFFSET_M_S2), _MAX_OFFSET_M_S2)
        wanted = lift_m_s2 + _HEIGHT_1_S2 * height_error + _CLIMB_1_S * climb_error + self._offset_m_s2
        lift = min(max(wanted, -_MAX_LIFT_M_S2), _MAX_LIFT_M_S2)
        upright = max(cos(state.euler[0]) * cos(state.euler[1]), _MIN_UPRIGHT)
        return self._weight_n * (1.0 + lift / self._gravity_m_s2) / upright


def vertically(context: TaskContext, climb_m_s: float, height_m: float | None) -> tuple[Reference, Target]:
    """Return reference and target of a climb, or of a height if given; horizontally at the vehicle."""
    kind = BindingDerivative.VELOCITY if height_m is None else BindingDerivative.POSITION
    place = (*context.place[:2], context.place[2] if height_m is None else height_m)
    target = still_target(
        place, context.yaw_rad, context.samples, (BindingDerivative.VELOCITY, BindingDerivative.VELOCITY, kind)
    )
    target.motion[:, 1, 2] = climb_m_s
    limits = context.behaviour.stick_limits or context.behaviour.limits
    _, after = lead(context.reference, target, limits, context.interval_s)
    moved = moving_with(context.state).motion
    moved[:, 2] = after.motion[:, 2]
    return Reference(moved, np.array([context.state.euler[2], 0.0])), target
