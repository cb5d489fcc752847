"""The interface of flight tasks."""

from typing import NamedTuple, Protocol, TypeAlias

from colibri.autopilot.control.interface import AttitudeDemand, Horizon, Pace, VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.reference import BindingDerivative, Reference, Target, target_of
from colibri.common.records import Record
from colibri.common.types import Vector
from colibri.mavlink.setpoints.setpoints import OffboardSetpoint, Sticks, TargetState

_LIFT_M, _LIFT_M_S = 0.15, 0.05


class ClientInputs(Record, frozen=True):
    sticks: Sticks | None = None
    setpoint: OffboardSetpoint | None = None
    followed: TargetState | None = None
    channels: tuple[int, ...] = ()  # of a radio, us


NOT_STEERED = ClientInputs()


class TaskContext(Record, frozen=True):
    now_us: int  # path time at which commands take effect
    state: VehicleState
    reference: Reference
    home_enu_m: Vector
    behaviour: Behaviour
    interval_s: float
    samples: int  # instants of a target
    steered: ClientInputs = NOT_STEERED
    standing: bool = False
    ground_m: float = 0.0  # z of ENU at the last standing position
    blind: bool = False  # whether the position is unusable
    home_yaw_rad: float = 0.0  # heading at arming

    @property
    def yaw_rad(self) -> float:
        return float(self.reference.heading[0])

    @property
    def place(self) -> Vector:
        x, y, z = self.reference.motion[0].tolist()
        return (x, y, z)

    @property
    def velocity(self) -> Vector:
        x, y, z = self.reference.motion[1].tolist()
        return (x, y, z)


class PositionMotion(Record, frozen=True):
    """Motion by position and yaw: target, limits and pace."""

    target: Target
    limits: Limits
    pace: Pace = Pace.CLOCK


class PlannedMotion(NamedTuple):
    """Motion along a plan; `for_law` is at the control law's instants."""

    horizon: Horizon
    limits: Limits
    for_law: Horizon | None = None
    pace: Pace = Pace.CATCHING_UP

    @property
    def target(self) -> Target:
        return target_of(self.horizon)


class AttitudeMotion(NamedTuple):
    """Motion by attitude and thrust: whether it lifts off, sinks, or lacks a reliable velocity (`drifts`)."""

    demand: AttitudeDemand
    reference: Reference
    lifts: bool
    sinks: bool
    drifts: bool = False


TaskOutput: TypeAlias = PositionMotion | PlannedMotion | AttitudeMotion


class FlightTask(Protocol):
    def update(self, context: TaskContext) -> TaskOutput: ...

    def arrived(self, context: TaskContext) -> bool: ...


class EndlessTask:
    def arrived(self, context: TaskContext) -> bool:
        del context
        return False


def lifts(target: Target, state: VehicleState) -> bool:
    """Whether a standing vehicle must take off."""
    end = target.motion[-1, :, 2]
    kind = target.kinds[2]
    if kind is BindingDerivative.POSITION:
        return bool(end[0] > state.position_enu_m[2] + _LIFT_M)
    return bool(end[1 if kind is BindingDerivative.VELOCITY else 2] > _LIFT_M_S)
