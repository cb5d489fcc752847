"""The stages of a vehicle on one track, without ground stations; exceptions are raised."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeVar, TypeVarTuple

from colibri.autopilot.control.delay import DelayCompensation
from colibri.autopilot.control.interface import Clock, Decision, Pace, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import Factory
from colibri.autopilot.core.autopilot import Autopilot, ControlSample
from colibri.autopilot.core.step import Received
from colibri.autopilot.estimation.state_source import NewEstimator, StateSource
from colibri.autopilot.guidance.guidance import Guidance
from colibri.autopilot.guidance.landing_detector import Landing, is_below, is_clear, stands_at_first, watch
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.hil.world_changes import WorldChange
from colibri.plant.vehicle.description import Vehicle

if TYPE_CHECKING:
    from colibri.mavlink.node.hub import Outgoing

T = TypeVar("T")
Ts = TypeVarTuple("Ts")


def track_autopilot(
    profile: Profile,
    vehicle: Vehicle,
    track: Track,
    clock: Clock,
    *,
    estimator: NewEstimator | None = None,
    law: Factory | None = None,
) -> "Autopilot[TrackStages]":
    """Return an autopilot that flies `vehicle` along `track` from time 0 on.

    Without an `estimator` it flies on the state; without a `law`, by the registered one.

    Raises:
        AutopilotError: The profile's control law, table or solver cannot be used.
    """
    loop = ControlLoop(profile, vehicle, clock, law, on_sensors=estimator is not None)
    state_source = StateSource(estimator, loop.frame_interval_us)
    delay = DelayCompensation(vehicle, profile.delay_s)
    planner = Planner(track, profile.references, loop.preview)
    start_speed = profile.simulation.rotor_speed(vehicle)
    return Autopilot(TrackStages(loop, delay, state_source, planner, start_speed), clock)


class TrackStages:
    """Flies a vehicle along a track; on sensors it is armed from the first estimate on."""

    mode = "track"

    def __init__(
        self,
        loop: ControlLoop,
        delay: DelayCompensation,
        state_source: StateSource,
        planner: Planner,
        start_speed: float,
    ) -> None:
        self.loop, self.delay, self.state_source = loop, delay, state_source
        self.repeats = not state_source.estimates
        self.time_us: int | None = None
        self._planner, self._start_speed = planner, start_speed
        self._acts_us: int | None = None
        self._landing, self._ground_m = Landing(), 0.0

    def guard(self, _part: str, call: Callable[[*Ts], T], _otherwise: Callable[[], T], *args: *Ts) -> T:
        return call(*args)

    def receive(self, _frame: Frame, plant_status: PlantStatus) -> None:
        if plant_status.battery is not None and plant_status.battery.exists:
            self.loop.know_charge(plant_status.battery.used_ah)
        if plant_status.delay_us is not None:
            self.delay.measure(plant_status.delay_us)

    def estimate(self, frame: Frame, *, now: bool) -> StateFrame | None:
        self.state_source.receive(frame)
        return self.state_source.state() if now else self.state_source.last

    def wait(self, _now_us: int) -> None:
        self.time_us = None

    def enter(self, known: StateFrame, now_us: int, *, begins: bool) -> None:
        if begins:
            self._begin(known)
        self.time_us = now_us

    def ahead(self, known: StateFrame) -> StateFrame:
        return self.delay.ahead(known, self.loop.charge_ah)

    def supervise(self, now_us: int, state: VehicleState) -> None: ...

    def guide(self, now_us: int, state: VehicleState) -> Guidance:
        loop = self.loop
        acts_us = self._acts_us = now_us + self.delay.delay_us
        references = self._planner.horizon_at(acts_us - loop.lag_us, loop.control_interval_us)
        sinks = is_below(references.position_enu_m.item(2), state)
        self._landing, _ = watch(self._landing, now_us, state, sinks)
        return Guidance(references, None, False, Pace.CATCHING_UP)

    def decide(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        assert guidance.horizon is not None, "a track has references at any time"
        if not is_clear(self._landing, state, self._ground_m):
            state = state._replace(airborne=False)
        return self.loop.decide(now_us, state, guidance.horizon, guidance.pace)

    def rescue(self, _known: StateFrame, _now_us: int) -> Decision | None:
        return None

    def actuate(self, now_us: int) -> ActuatorCommand:
        return ActuatorCommand(now_us, self.loop.controls, True)

    def faults(self) -> tuple[Fault | WorldChange, ...]:
        return ()

    def sampled(self, sample: ControlSample, duration_s: float) -> None: ...

    def serve(self, _inbox: Iterable[Received]) -> "list[Outgoing]":
        self.state_source.settle()
        if self._acts_us is not None:
            interval_us = self.loop.control_interval_us
            self._planner.prepare(self._acts_us + interval_us - self.loop.lag_us, interval_us)
            self._acts_us = None
        return []

    def _begin(self, known: StateFrame) -> None:
        loop, source = self.loop, self.state_source
        speed = self._start_speed if known.time_us == 0 else loop.vehicle.hover_speed
        rests = self.time_us is None and source.rests
        if rests:
            speed = loop.vehicle.rotors.idle_speed
        loop.begin(speed, float(self._planner.horizon(known.time_us).yaw_rad[0]))
        self.delay.begin(loop.controls, rests=source.rests)
        state = loop.observe(known)
        self._landing, self._ground_m = Landing(), 0.0
        if rests or stands_at_first(state, 0.0):
            self._ground_m = state.position_enu_m[2]
