"""The autopilot as a pure composition: a frame of the vehicle's state in, the rotor command that answers it out."""

from typing import Any, NamedTuple

import numpy as np

from autopilot.controller import (
    Array,
    Clock,
    Controller,
    Decision,
    VehicleState,
    check_controller,
    check_rotor_speeds,
    load_controller,
)
from autopilot.planner import plan
from autopilot.profile import Profile, ProfileError
from autopilot.settings import SettingsError
from autopilot.tracks import Track
from mavlink.frames import euler_from_quaternion, nearest_turn
from mavlink.hil import ActuatorCommand, StateFrame
from plant.vehicle import Vehicle


class Step(NamedTuple):
    """The answer to a frame: the command to send, the decision behind it, and how long it took.

    Between two control samples the last command is sent again, and there is no decision.
    """

    command: ActuatorCommand
    decision: Decision | None
    duration_s: float


class Autopilot:
    """Flies one track with one control law.

    Attributes:
        frame_interval_us: How often it wants a frame: at every control sample, or a whole number of times as often.
    """

    def __init__(self, profile: Profile, vehicle: Vehicle, track: Track, clock: Clock) -> None:
        """Fly `vehicle` along `track`; `clock` only measures, it decides nothing.

        Raises:
            ControllerError: The profile's control law cannot be used.
            ProfileError: Its table is wrong.
            SolverError: Its solver cannot be used.
        """
        self._name = profile.controller
        self._controller = _build(profile, vehicle, clock)
        self._planner = plan(track, profile.references, self._controller.preview)
        self._start_speed = vehicle.speed_from_rpm(profile.simulation.rotor_speed_rpm)
        self._vehicle = vehicle
        self._clock = clock
        self._memory: Any = None
        self._time_us: int | None = None
        self._yaw_rad = 0.0
        self._controls = (0.0, 0.0, 0.0, 0.0)
        self.frame_interval_us = _frame_interval_us(profile, self._controller.control_interval_us)

    def step(self, frame: StateFrame) -> Step:
        """Answer a frame.

        Frames follow one another at the frame interval. One that does not begins a new flight: with the profile's
        rotor speed at time 0, and with hover in mid-flight, where nothing is known of the rotors.

        Raises:
            DecisionError: The control law gave what no rotor can follow.
        """
        started_s = self._clock()
        if self._time_us is None or frame.time_us != self._time_us + self.frame_interval_us:
            self._begin(frame)
        self._time_us = frame.time_us
        state = self._state(frame)
        decision = None
        if frame.time_us % self._controller.control_interval_us == 0:
            references = self._planner.horizon(frame.time_us)
            self._memory, decision = self._controller.step(self._memory, frame.time_us, state, references)
            self._controls = self._controls_of(decision.rotor_speeds)
        command = ActuatorCommand(frame.time_us, self._controls, armed=True)
        return Step(command, decision, self._clock() - started_s)

    def _begin(self, frame: StateFrame) -> None:
        speed = self._start_speed if frame.time_us == 0 else self._vehicle.hover_speed
        self._memory = self._controller.initial(speed)
        self._yaw_rad = float(self._planner.horizon(frame.time_us).yaw_rad[0])
        self._controls = self._controls_of(np.full(4, speed))

    def _controls_of(self, rotor_speeds: Array) -> tuple[float, float, float, float]:
        """Return rotor speeds as parts of the largest."""
        check_rotor_speeds(self._name, rotor_speeds, self._vehicle.rotors.max_speed)
        c1, c2, c3, c4 = (rotor_speeds / self._vehicle.rotors.max_speed).tolist()
        return (c1, c2, c3, c4)

    def _state(self, frame: StateFrame) -> VehicleState:
        """Unwrap yaw by continuity: a quaternion forgets full turns."""
        phi, theta, psi = euler_from_quaternion(frame.attitude)
        self._yaw_rad = nearest_turn(psi, self._yaw_rad)
        euler = (phi, theta, self._yaw_rad)
        return VehicleState(frame.position_enu_m, frame.velocity_enu_m_s, frame.attitude, euler, frame.rate_flu_rad_s)


def _frame_interval_us(profile: Profile, control_interval_us: int) -> int:
    """Return the longest interval of whole milliseconds that divides the control interval, as short as asked for."""
    wanted_s = profile.simulation.frame_interval_s
    if wanted_s is None:
        return control_interval_us
    control_ms, wanted_ms = control_interval_us // 1000, round(wanted_s * 1e6) // 1000
    return 1000 * max(ms for ms in range(1, control_ms + 1) if control_ms % ms == 0 and ms <= wanted_ms)


def _build(profile: Profile, vehicle: Vehicle, clock: Clock) -> Controller[Any]:
    factory = load_controller(profile.controller)
    try:
        controller = factory(profile.table(profile.controller), vehicle, clock)
    except SettingsError as error:
        if profile.controller not in profile.controllers:
            known = ", ".join(profile.controllers)
            raise ProfileError(
                f"profile {profile.name} has no numbers for controller {profile.controller}, only for {known}: "
                f"choose another profile, or add a table controllers.{profile.controller} to a copy of it"
            ) from error
        raise ProfileError(f"profile {profile.name}: controllers.{profile.controller}: {error}") from error
    check_controller(profile.controller, controller)
    return controller
