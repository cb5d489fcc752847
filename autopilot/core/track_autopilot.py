"""An autopilot that flies one track, without ground stations."""

from colibri.autopilot.control.delay import DelayCompensation
from colibri.autopilot.control.interface import Clock, Pace, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import Factory
from colibri.autopilot.core.step import Step, follows, nothing_known
from colibri.autopilot.estimation.state_source import NewEstimator, StateSource
from colibri.autopilot.guidance.landing_detector import Landing, is_below, is_clear, stands_at_first, watch
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.mavlink.hil.plant_status import NOTHING, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.plant.vehicle.description import Vehicle


class Autopilot:
    """Flies one track with one control law.

    Attributes:
        frame_interval_us: How often it wants a frame: at every control sample, or a whole number of times as often.
    """

    def __init__(
        self,
        profile: Profile,
        vehicle: Vehicle,
        track: Track,
        clock: Clock,
        *,
        estimator: NewEstimator | None = None,
        law: Factory | None = None,
    ) -> None:
        """Fly `vehicle` along `track`; `clock` only measures, it decides nothing.

        Args:
            profile: The control law and its numbers.
            vehicle: That it controls.
            track: What it flies, from time 0 on.
            clock: Seconds.
            estimator: Makes what turns frames of sensors into states; None: frames are states.
            law: Makes the control law; None: as it is registered.

        Raises:
            ControllerError: The profile's control law cannot be used.
            ProfileError: Its table is wrong.
            SolverError: Its solver cannot be used.
        """
        self._loop = ControlLoop(profile, vehicle, clock, law)
        self._delay = DelayCompensation(vehicle, profile.delay_s)
        self._planner = Planner(track, profile.references, self._loop.preview)
        self._start_speed = vehicle.speed_from_rpm(profile.simulation.rotor_speed_rpm)
        self._clock = clock
        self._time_us: int | None = None
        self._acts_us: int | None = None
        self._landing, self._ground_m = Landing(), 0.0
        self.frame_interval_us = self._loop.frame_interval_us
        self._state_source = StateSource(estimator, self.frame_interval_us)

    def step(self, frame: Frame, plant_status: PlantStatus = NOTHING) -> Step:
        """Answer a frame and the plant status beside it.

        A plant that runs freely may lose a few frames. One that comes much later, or earlier, begins a new flight:
        with the profile's rotor speed at time 0, and with hover in mid-flight. On sensors a flight begins with the
        first estimate, of a vehicle that stands, or falls; until then it is not armed.

        Raises:
            DecisionError: The control law gave what no rotor can follow.
        """
        started_s = self._clock()
        if plant_status.battery is not None:
            self._loop.know_charge(plant_status.battery.used_ah)
        if plant_status.delay_us is not None:
            self._delay.measure(plant_status.delay_us)
        due = self._loop.is_due(frame.time_us)
        known = self._state_source.state(frame, asked=due, settles=True)
        if known is None:
            self._time_us = None
            return nothing_known(frame.time_us, self._clock() - started_s)
        if not follows(frame.time_us, self._time_us, self.frame_interval_us):
            self._begin(known)
        self._time_us = frame.time_us
        decision = references = None
        if due:
            state = self._loop.state(self._delay.ahead(known, self._loop.charge_ah))
            acts_us = self._acts_us = frame.time_us + self._delay.delay_us
            references = self._planner.horizon_at(acts_us - self._loop.lag_us, self._loop.control_interval_us)
            sinks = is_below(float(references.position_enu_m[0, 2]), state)
            self._landing, _ = watch(self._landing, frame.time_us, state, sinks)
            state = VehicleState(*state[:-1], airborne=is_clear(self._landing, state, self._ground_m))
            decision = self._loop.decide(frame.time_us, state, references, Pace.CATCHING_UP)
        command = ActuatorCommand(frame.time_us, self._loop.controls, armed=True)
        self._delay.sent(command)
        estimate = self._state_source.estimate if due else None
        duration_s = self._clock() - started_s
        return Step(
            *(command, decision, duration_s, estimate),
            delay_us=self._delay.delay_us,
            frame=frame if due else None,
            references=references,
        )

    def settle(self) -> None:
        """Do what need not be done before an answer, while the plant integrates; else the next step does it."""
        self._state_source.settle()
        if self._acts_us is not None:
            interval_us = self._loop.control_interval_us
            self._planner.prepare(self._acts_us + interval_us - self._loop.lag_us, interval_us)
            self._acts_us = None

    def _begin(self, frame: StateFrame) -> None:
        vehicle = self._loop.vehicle
        speed = self._start_speed if frame.time_us == 0 else vehicle.hover_speed
        rests = self._time_us is None and self._state_source.rests
        if rests:
            speed = vehicle.rotors.idle_speed
        self._loop.begin(speed, float(self._planner.horizon(frame.time_us).yaw_rad[0]))
        self._delay.begin(self._loop.controls, rests=self._state_source.rests)
        state = self._loop.state(frame)
        self._landing, self._ground_m = Landing(), 0.0
        if rests or stands_at_first(state, 0.0):
            self._ground_m = state.position_enu_m[2]
