"""Courses by attitude and thrust: what sticks or a companion ask for, made smooth, and height held under sticks."""

import numpy as np

from colibri.autopilot.guidance.attitude_reference import AttitudeReference, ReferenceMemory, Wish, lean
from colibri.autopilot.guidance.landing_detector import CARRIED, is_below
from colibri.autopilot.guidance.reference import Kind, Reference, Target, lead, moving_with, still_target
from colibri.autopilot.guidance.tasks.position import Stop, sinking_m_s
from colibri.autopilot.guidance.tasks.sticks import stick_climb, without_play
from colibri.autopilot.guidance.tasks.task import Endless, Lean, Motion, Scene, lifts
from colibri.common.kernels import cos
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, Sticks

_LIFTING, _SINKING = 0.9, 0.5
"""Thrust in parts of the weight from which on a vehicle takes off, and below which it must sink."""
_HEIGHT_1_S2, _CLIMB_1_S, _INTEGRAL_1_S3 = 9.0, 6.0, 4.0
"""Poles of the height loop near -3 and -2, 1/s; the integral removes what a wrong mass or a tired battery leave."""
_MAX_LIFT_M_S2, _MAX_OFFSET_M_S2 = 6.0, 4.0
_MIN_UPRIGHT = 0.5
_RESTS_M_S = 0.025


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
        return self._leaning.by_wish(self._generator.from_sticks(without_play(sticks)), scene)


class AltitudeSticks(Endless):
    """Sticks to tilt, yaw rate and climb; height is held while its stick is in the middle."""

    def __init__(self, generator: AttitudeReference, gravity_m_s2: float) -> None:
        """Begin with the attitude and height that the vehicle has."""
        self._leaning = Leaning(generator)
        self._generator = generator
        self._stop = Stop()
        self._loop = HeightLoop(generator.weight_n, gravity_m_s2)
        self._height_m: float | None = None

    def ask(self, scene: Scene) -> Motion | Lean:
        """Return what the sticks ask for; without sticks, stop."""
        sticks = scene.steered.sticks
        if sticks is None:
            return self._stop.ask(scene)
        reference, lifting = self._climb(sticks, scene)
        wish = self._generator.from_sticks(without_play(sticks))._replace(
            thrust_n=self._loop.thrust_n(reference, scene)
        )
        leaning = self._leaning.by_wish(wish, scene)
        return leaning._replace(reference=reference, lifts=lifting, sinks=is_below(reference, scene.state))

    def _climb(self, sticks: Sticks, scene: Scene) -> tuple[Reference, bool]:
        """Return the height's reference, where the vehicle is otherwise, and whether it is to leave the ground."""
        climb_m_s = stick_climb(sticks, scene)
        if climb_m_s != 0.0:
            self._height_m = None
        elif self._height_m is None and abs(scene.velocity[2]) < _RESTS_M_S:
            self._height_m = scene.place[2]
        reference, target = vertically(scene, climb_m_s, self._height_m)
        return reference, lifts(target, scene.state)


class Descent(Endless):
    """Level, and down at the speed of landings: for a vehicle that does not know where it is, or which way it looks."""

    def __init__(self, generator: AttitudeReference, gravity_m_s2: float) -> None:
        """Begin with the attitude and climb that the vehicle has."""
        self._leaning = Leaning(generator)
        self._weight_n = generator.weight_n
        self._loop = HeightLoop(self._weight_n, gravity_m_s2)

    def ask(self, scene: Scene) -> Lean:
        """Return a level attitude, and the thrust that sinks."""
        reference, _ = vertically(scene, -sinking_m_s(scene), None)
        thrust_n = self._loop.thrust_n(reference, scene)
        leaning = self._leaning.by_wish(lean(0.0, 0.0, 0.0, thrust_n), scene)
        sinks = thrust_n < CARRIED * self._weight_n
        return leaning._replace(reference=reference, lifts=False, sinks=sinks, drifts=True)


class HeightLoop:
    """The thrust that follows the height of a reference, whatever the vehicle leans."""

    def __init__(self, weight_n: float, gravity_m_s2: float) -> None:
        """Begin with nothing to make up for."""
        self._weight_n, self._gravity_m_s2 = weight_n, gravity_m_s2
        self._offset_m_s2 = 0.0

    def thrust_n(self, reference: Reference, scene: Scene) -> float:
        """Return the thrust, N, that brings the vehicle to the height of `reference`."""
        height_m, climb_m_s, lift_m_s2 = (float(order) for order in reference.motion[:3, 2])
        state = scene.state
        height_error, climb_error = height_m - state.position_enu_m[2], climb_m_s - state.velocity_enu_m_s[2]
        self._offset_m_s2 += _INTEGRAL_1_S3 * height_error * scene.interval_s
        self._offset_m_s2 = min(max(self._offset_m_s2, -_MAX_OFFSET_M_S2), _MAX_OFFSET_M_S2)
        wanted = lift_m_s2 + _HEIGHT_1_S2 * height_error + _CLIMB_1_S * climb_error + self._offset_m_s2
        lift = min(max(wanted, -_MAX_LIFT_M_S2), _MAX_LIFT_M_S2)
        upright = max(cos(state.euler[0]) * cos(state.euler[1]), _MIN_UPRIGHT)
        return self._weight_n * (1.0 + lift / self._gravity_m_s2) / upright


def vertically(scene: Scene, climb_m_s: float, height_m: float | None) -> tuple[Reference, Target]:
    """Return a reference that climbs, or goes to a height where one is given, and where it leads.

    Horizontally it is where the vehicle is.
    """
    kind = Kind.VELOCITY if height_m is None else Kind.POSITION
    place = (*scene.place[:2], scene.place[2] if height_m is None else height_m)
    target = still_target(place, scene.yaw_rad, scene.samples, (Kind.VELOCITY, Kind.VELOCITY, kind))
    target.motion[:, 1, 2] = climb_m_s
    _, after = lead(scene.reference, target, scene.behaviour.limits, scene.interval_s)
    moved = moving_with(scene.state).motion
    moved[:, 2] = after.motion[:, 2]
    return Reference(moved, np.array([scene.state.euler[2], 0.0])), target
