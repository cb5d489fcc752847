"""The interface of flight tasks: given the context once a control sample, a task returns a motion."""

from typing import NamedTuple, Protocol, TypeAlias

from colibri.autopilot.control.interface import AttitudeDemand, Horizon, Pace, VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.reference import Kind, Reference, Target, target_of
from colibri.common.types import Vector
from colibri.mavlink.setpoints.setpoints import OffboardSetpoint, Sticks, TargetState

_LIFT_M, _LIFT_M_S = 0.15, 0.05


class Steered(NamedTuple):
    """Latest input of clients: a pilot's sticks, a companion's setpoint, the target to follow; None without."""

    sticks: Sticks | None = None
    setpoint: OffboardSetpoint | None = None
    followed: TargetState | None = None


NOT_STEERED = Steered()


class TaskContext(NamedTuple):
    """Inputs of a task.

    Attributes:
        now_us: Simulated time at which what is decided takes effect, less the control law's lag: path time.
        state: The vehicle then.
        interval_s: Between two instants of a target.
        samples: How many instants a target has.
        steered: Latest input of clients.
        ground_m: Height of where it last stood, z of ENU.
        blind: Whether the position is not to be flown by: a landing is level then.
    """

    now_us: int
    state: VehicleState
    reference: Reference
    home_enu_m: Vector
    behaviour: Behaviour
    interval_s: float
    samples: int
    steered: Steered = NOT_STEERED
    standing: bool = False
    ground_m: float = 0.0
    blind: bool = False

    @property
    def yaw_rad(self) -> float:
        """Heading of the reference."""
        return float(self.reference.heading[0])

    @property
    def place(self) -> Vector:
        """Position of the reference."""
        x, y, z = self.reference.motion[0].tolist()
        return (x, y, z)

    @property
    def velocity(self) -> Vector:
        """Velocity of the reference."""
        x, y, z = self.reference.motion[1].tolist()
        return (x, y, z)


class Motion(NamedTuple):
    """Motion by position and yaw: the target of the reference, the limits on the way there, and its pace."""

    target: Target
    limits: Limits
    pace: Pace = Pace.CLOCK


class PlannedMotion(NamedTuple):
    """Motion along a plan: the horizon that the reference is to reach, and the limits on the way there.

    Attributes:
        for_law: The horizon at the control law's instants, where those differ.
    """

    horizon: Horizon
    limits: Limits
    for_law: Horizon | None = None
    pace: Pace = Pace.CATCHING_UP

    @property
    def target(self) -> Target:
        """The plan as a target."""
        return target_of(self.horizon)


class AttitudeMotion(NamedTuple):
    """Motion by attitude and thrust.

    Attributes:
        reference: Where the reference stands meanwhile.
        lifts: Whether a vehicle that stands must leave the ground for it.
        sinks: Whether a vehicle in the air must sink.
        drifts: Whether the velocity is unreliable: see `landing_detector.watch`.
    """

    demand: AttitudeDemand
    reference: Reference
    lifts: bool
    sinks: bool
    drifts: bool = False


TaskOutput: TypeAlias = Motion | PlannedMotion | AttitudeMotion


class FlightTask(Protocol):
    """A way to fly."""

    def update(self, context: TaskContext) -> TaskOutput:
        """Return what is to be flown from now on. Called once a control sample."""
        ...

    def arrived(self, context: TaskContext) -> bool:
        """Whether it is flown to its end."""
        ...


class EndlessTask:
    """A task that something else ends: the ground, a command, silence."""

    def arrived(self, context: TaskContext) -> bool:
        """Never by itself."""
        del context
        return False


def lifts(target: Target, state: VehicleState) -> bool:
    """Whether a vehicle that stands must leave the ground for this target."""
    end = target.motion[-1, :, 2]
    kind = target.kinds[2]
    if kind is Kind.POSITION:
        return bool(end[0] > state.position_enu_m[2] + _LIFT_M)
    return bool(end[1 if kind is Kind.VELOCITY else 2] > _LIFT_M_S)
