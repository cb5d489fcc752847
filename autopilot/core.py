"""The autopilot as a pure composition: a frame of the vehicle in, the rotor command that answers it out."""

from typing import NamedTuple

from autopilot.controller import Clock, Decision
from autopilot.estimate import Estimate
from autopilot.loop import ControlLoop
from autopilot.planner import plan
from autopilot.profile import Profile
from autopilot.senses import Estimator, Senses
from autopilot.tracks import Track
from mavlink.aside import Aside
from mavlink.failures import Fault
from mavlink.hil import ActuatorCommand
from mavlink.sensors import Frame
from plant.vehicle import Vehicle

STILL = (0.0, 0.0, 0.0, 0.0)
"""Rotors that stand."""


MISSED_US = 100_000
"""Frames of so long a time may be missing: what is known of the rotors still holds, more or less."""


def follows(time_us: int, before_us: int | None, interval_us: int) -> bool:
    """Whether a frame goes on from the one before, where they come every `interval_us`."""
    return before_us is not None and 0 < time_us - before_us <= max(interval_us, MISSED_US)


class Step(NamedTuple):
    """The answer to a frame: the command to send, the decision behind it, and how long it took.

    Between two control samples the last command is sent again, and there is no decision. Where the state is told, there
    is no estimate. Faults are what the plant is asked to have happen with the command. As long as nothing is `known` of
    the vehicle, its rotors stand.
    """

    command: ActuatorCommand
    decision: Decision | None
    duration_s: float
    estimate: Estimate | None = None
    faults: tuple[Fault, ...] = ()
    known: bool = True


def nothing_known(time_us: int, duration_s: float) -> Step:
    """Return the answer to a frame of a vehicle of which nothing is known."""
    return Step(ActuatorCommand(time_us, STILL, armed=False), None, duration_s, known=False)


class Autopilot:
    """Flies one track with one control law.

    Attributes:
        frame_interval_us: How often it wants a frame: at every control sample, or a whole number of times as often.
    """

    def __init__(
        self, profile: Profile, vehicle: Vehicle, track: Track, clock: Clock, *, estimator: Estimator | None = None
    ) -> None:
        """Fly `vehicle` along `track`; `clock` only measures, it decides nothing.

        Args:
            profile: The control law and its numbers.
            vehicle: That it controls.
            track: What it flies, from time 0 on.
            clock: Seconds.
            estimator: Makes what turns frames of sensors into states; None: frames are states.

        Raises:
            ControllerError: The profile's control law cannot be used.
            ProfileError: Its table is wrong.
            SolverError: Its solver cannot be used.
        """
        self._loop = ControlLoop(profile, vehicle, clock)
        self._planner = plan(track, profile.references, self._loop.preview)
        self._start_speed = vehicle.speed_from_rpm(profile.simulation.rotor_speed_rpm)
        self._clock = clock
        self._time_us: int | None = None
        self.frame_interval_us = self._loop.frame_interval_us
        self._senses = Senses(estimator, self.frame_interval_us)

    def hear(self, aside: Aside) -> None:
        """Take in what the plant tells beside the frame of the next step."""
        if aside.battery is not None:
            self._loop.know_charge(aside.battery.used_ah)

    def step(self, frame: Frame) -> Step:
        """Answer a frame.

        Frames follow one another at the frame interval; a plant that runs freely may lose a few. One that comes much
        later, or earlier, begins a new flight: with the profile's rotor speed at time 0, and with hover in mid-flight,
        where nothing is known of the rotors. On sensors a flight
        begins with the first estimate, of a vehicle that stands, or falls; until then it is not armed.

        Raises:
            DecisionError: The control law gave what no rotor can follow.
        """
        started_s = self._clock()
        due = self._loop.is_due(frame.time_us)
        known = self._senses.state(frame, asked=due)
        if known is None:
            self._time_us = None
            return nothing_known(frame.time_us, self._clock() - started_s)
        if not follows(frame.time_us, self._time_us, self.frame_interval_us):
            self._begin(frame)
        self._time_us = frame.time_us
        decision = None
        if due:
            state = self._loop.state(known)
            decision = self._loop.decide(frame.time_us, state, self._planner.horizon(frame.time_us))
        command = ActuatorCommand(frame.time_us, self._loop.controls, armed=True)
        return Step(command, decision, self._clock() - started_s, self._senses.estimate if due else None)

    def _begin(self, frame: Frame) -> None:
        vehicle = self._loop.vehicle
        speed = self._start_speed if frame.time_us == 0 else vehicle.hover_speed
        if self._time_us is None and self._senses.rests:
            speed = vehicle.rotors.idle_speed
        self._loop.begin(speed, float(self._planner.horizon(frame.time_us).yaw_rad[0]))
