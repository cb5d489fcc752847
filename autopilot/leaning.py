"""Courses by attitude and thrust: what sticks or a companion ask for, made smooth, and height held under sticks."""

from math import cos, radians

import numpy as np

from autopilot.attitude_reference import AttitudeReference, ReferenceMemory, Wish, lean
from autopilot.course import Endless, Lean, Motion, Scene, lifts
from autopilot.courses import Stop
from autopilot.landing import is_below
from autopilot.reference import Kind, Reference, lead, moving_with, still_target
from autopilot.sticks import dead, stick_climb, stick_yaw_rate
from mavlink.setpoints import AttitudeSetpoint, Sticks

_LIFTING, _SINKING = 0.9, 0.5
"""Thrust in parts of the weight from which on a vehicle takes off, and below which it must sink."""
_HEIGHT_1_S2, _CLIMB_1_S, _INTEGRAL_1_S3 = 9.0, 6.0, 4.0
"""Poles of the height loop near -3 and -2, 1/s; the integral removes what a wrong mass or a tired battery leave."""
_MOST_LIFT_M_S2, _MOST_OFFSET_M_S2 = 6.0, 4.0


class Leaning:
    """Attitude and thrust, smoothly, as a generator of demands makes them."""

    def __init__(self, generator: AttitudeReference) -> None:
        """Begin with the attitude that the vehicle has at the first demand."""
        self._generator = generator
        self._memory: ReferenceMemory | None = None

    def forget(self) -> None:
        """Begin anew at the next demand."""
        self._memory = None

    def by_setpoint(self, setpoint: AttitudeSetpoint, scene: Scene) -> Lean:
        """Return what a companion's setpoint asks for."""
        return self.by_wish(self._generator.from_setpoint(setpoint), scene)

    def by_wish(self, wish: Wish, scene: Scene) -> Lean:
        """Return what is asked for, as smoothly as the vehicle can follow."""
        if self._memory is None:
            self._memory = self._generator.initial(scene.state)
        self._memory, demand = self._generator.step(self._memory, scene.state, wish)
        # nan asks for no thrust of its own: a vehicle that stands stays, one that flies does not sink
        share = wish.thrust_n / self._generator.weight_n
        return Lean(demand, moving_with(scene.state), lifts=share > _LIFTING, sinks=share < _SINKING)


class Stabilized(Endless):
    """Sticks to tilt, yaw rate and thrust."""

    def __init__(self, generator: AttitudeReference) -> None:
        """Begin with the attitude that the vehicle has."""
        self._leaning = Leaning(generator)
        self._generator = generator
        self._stop = Stop()

    def ask(self, scene: Scene) -> Motion | Lean:
        """Return what the sticks ask for; without sticks, stop."""
        sticks = scene.steered.sticks
        if sticks is None:
            return self._stop.ask(scene)
        thrust_n = self._generator.thrust_for_stick(sticks.thrust)
        return self._leaning.by_wish(wish_of(sticks, thrust_n, scene), scene)


class AltitudeSticks(Endless):
    """Sticks to tilt, yaw rate and climb; height is held while its stick is in the middle."""

    def __init__(self, generator: AttitudeReference, gravity_m_s2: float) -> None:
        """Begin with the attitude and height that the vehicle has."""
        self._leaning = Leaning(generator)
        self._generator = generator
        self._gravity_m_s2 = gravity_m_s2
        self._stop = Stop()
        self._height_m: float | None = None
        self._offset_m_s2 = 0.0

    def ask(self, scene: Scene) -> Motion | Lean:
        """Return what the sticks ask for; without sticks, stop."""
        sticks = scene.steered.sticks
        if sticks is None:
            return self._stop.ask(scene)
        reference, lifting = self._climb(sticks, scene)
        height_error = float(reference.motion[0, 2]) - scene.state.position_enu_m[2]
        climb_error = float(reference.motion[1, 2]) - scene.state.velocity_enu_m_s[2]
        step = _INTEGRAL_1_S3 * height_error * scene.interval_s
        self._offset_m_s2 = min(max(self._offset_m_s2 + step, -_MOST_OFFSET_M_S2), _MOST_OFFSET_M_S2)
        wanted = float(reference.motion[2, 2]) + _HEIGHT_1_S2 * height_error + _CLIMB_1_S * climb_error
        lift = min(max(wanted + self._offset_m_s2, -_MOST_LIFT_M_S2), _MOST_LIFT_M_S2)
        upright = max(cos(scene.state.euler[0]) * cos(scene.state.euler[1]), 0.5)
        thrust_n = self._generator.weight_n * (1.0 + lift / self._gravity_m_s2) / upright
        leaning = self._leaning.by_wish(wish_of(sticks, thrust_n, scene), scene)
        sinks = is_below(reference, scene.state)
        return leaning._replace(reference=reference, lifts=lifting, sinks=sinks)

    def _climb(self, sticks: Sticks, scene: Scene) -> tuple[Reference, bool]:
        """Return the height's reference, where the vehicle is otherwise, and whether it is to leave the ground."""
        climb_m_s = stick_climb(sticks, scene)
        rests = abs(float(scene.reference.motion[1, 2])) < _SINKING * 0.1
        if climb_m_s != 0.0:
            self._height_m = None
        elif self._height_m is None and rests:
            self._height_m = scene.place[2]
        kind = Kind.VELOCITY if self._height_m is None else Kind.POSITION
        height_m = scene.place[2] if self._height_m is None else self._height_m
        target = still_target(
            (*scene.place[:2], height_m), scene.yaw_rad, scene.samples, (Kind.VELOCITY, Kind.VELOCITY, kind)
        )
        target.motion[:, 1, 2] = climb_m_s
        _, after = lead(scene.reference, target, scene.behaviour.limits, scene.interval_s)
        moved = moving_with(scene.state).motion
        moved[:, 2] = after.motion[:, 2]
        return Reference(moved, np.array([scene.state.euler[2], 0.0])), lifts(target, scene.state)


def wish_of(sticks: Sticks, thrust_n: float, scene: Scene) -> Wish:
    """Return the tilt and the turn that sticks ask for, with a thrust."""
    tilt = radians(scene.behaviour.largest_tilt_deg)
    return lean(tilt * dead(sticks.roll), tilt * dead(sticks.pitch), stick_yaw_rate(sticks, scene), thrust_n)
