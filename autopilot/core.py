"""The autopilot as a pure composition: a frame of the vehicle's state in, the rotor command that answers it out."""

from collections.abc import Callable
from typing import NamedTuple

from autopilot.cascade import Cascade, Decision, Memory, VehicleState
from autopilot.planner import SampledPlanner
from autopilot.profile import Profile
from autopilot.tracks import Track
from mavlink.frames import euler_from_quaternion, nearest_turn
from mavlink.hil import ActuatorCommand, StateFrame
from plant.vehicle import Vehicle


class Step(NamedTuple):
    """One control sample: the command to send, the decision behind it, and how long it took."""

    command: ActuatorCommand
    decision: Decision
    duration_s: float


class Autopilot:
    """Flies one track with one profile."""

    def __init__(self, profile: Profile, vehicle: Vehicle, track: Track, clock: Callable[[], float]) -> None:
        """Fly `vehicle` along `track`; `clock` only measures, it decides nothing.

        Raises:
            SolverError: The profile's solver cannot be used.
        """
        self._interval_us = profile.control_interval_us
        self._start_speed = vehicle.speed_from_rpm(profile.simulation.rotor_speed_rpm)
        self._vehicle = vehicle
        self._clock = clock
        self._controller = Cascade(profile, vehicle, clock)
        outer_interval_s = profile.control_interval_s * profile.position.samples
        self._planner = SampledPlanner(track, outer_interval_s, self._controller.preview)
        self._memory: Memory | None = None
        self._time_us = 0
        self._yaw_rad = 0.0

    def step(self, frame: StateFrame) -> Step:
        """Answer a frame.

        Frames follow one another at the control interval. One that does not begins a new flight: with the profile's
        rotor speed at time 0, and with hover in mid-flight, where nothing is known of the rotors.
        """
        started_s = self._clock()
        references = self._planner.horizon(frame.time_us)
        if self._memory is None or frame.time_us != self._time_us + self._interval_us:
            speed = self._start_speed if frame.time_us == 0 else self._vehicle.hover_speed
            self._memory = self._controller.initial(speed)
            self._yaw_rad = float(references.yaw_rad[0])
        self._time_us = frame.time_us
        self._memory, decision = self._controller.step(self._memory, frame.time_us, self._state(frame), references)
        c1, c2, c3, c4 = (decision.rotor_speeds / self._vehicle.rotors.max_speed).tolist()
        command = ActuatorCommand(frame.time_us, (c1, c2, c3, c4), armed=True)
        return Step(command, decision, self._clock() - started_s)

    def _state(self, frame: StateFrame) -> VehicleState:
        """Unwrap yaw by continuity: a quaternion forgets full turns."""
        phi, theta, psi = euler_from_quaternion(frame.attitude)
        self._yaw_rad = nearest_turn(psi, self._yaw_rad)
        euler = (phi, theta, self._yaw_rad)
        return VehicleState(frame.position_enu_m, frame.velocity_enu_m_s, euler, frame.rate_flu_rad_s)
