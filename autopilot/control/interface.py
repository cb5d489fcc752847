"""The interface of a control law.

A package registers its law, a class, under the entry point group `colibri.controllers`. At each control sample the law
maps memory, state and references to rotor speeds and a new memory. Without other state, equal inputs give equal
flights.
"""

from collections.abc import Callable
from enum import Enum, StrEnum
from math import nan
from typing import NamedTuple, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np

from colibri.autopilot.control.qp import QpStatus
from colibri.common.rotations import earth_from_body
from colibri.common.types import Array, PerRotor, Quaternion, Vector

Clock: TypeAlias = Callable[[], float]  # seconds, to measure durations; a decision must not depend on it
Memory = TypeVar("Memory")


class Preview(NamedTuple):
    """Demanded references.

    Attributes:
        interval_us: Between two references; the first is at the start of the present interval.
        samples: Number of references.
    """

    interval_us: int
    samples: int


class Horizon(NamedTuple):
    """References from now on, at the preview's interval.

    Attributes:
        position_enu_m, velocity_enu_m_s: (n, 3) each, ENU.
        acceleration_enu_m_s2, jerk_enu_m_s3, snap_enu_m_s4: (n, 3) each, ENU; zero if planned by differences.
        yaw_rad: (n,), rad, counter-clockwise from east, unwrapped.
        yaw_rate_rad_s, yaw_acceleration_rad_s2: (n,); zero if planned by differences, or at a held yaw.
    """

    position_enu_m: Array
    velocity_enu_m_s: Array
    acceleration_enu_m_s2: Array
    jerk_enu_m_s3: Array
    snap_enu_m_s4: Array
    yaw_rad: Array
    yaw_rate_rad_s: Array
    yaw_acceleration_rad_s2: Array


class AttitudeDemand(NamedTuple):
    """Demanded attitude and thrust from now on, at the preview's interval.

    Attributes:
        angles: phi, theta, psi, rad, psi unwrapped, (n, 3).
        angle_rates_rad_s: Their derivatives, (n, 3).
        thrust_n: Along the body's z axis, (n,).
    """

    angles: Array
    angle_rates_rad_s: Array
    thrust_n: Array


_ZERO = (0.0, 0.0, 0.0)


class VehicleState(NamedTuple):
    """The state of the vehicle.

    Attributes:
        position_enu_m, velocity_enu_m_s: ENU.
        attitude: Unit quaternion wxyz, FLU body to ENU earth.
        euler: phi, theta, psi in rad, psi unwrapped.
        rate_flu_rad_s: Body rates p, q, r, FLU.
        acceleration_enu_m_s2: Mean since the previous control sample, or over a compensated delay, ENU; first zero.
        rotor_speeds: Of the model: the law's commands after the rotor lag, in the vehicle's unit and rotor order.
        airborne: Clear of the ground: only air and rotors act on the vehicle.
    """

    position_enu_m: Vector
    velocity_enu_m_s: Vector
    attitude: Quaternion
    euler: Vector
    rate_flu_rad_s: Vector
    acceleration_enu_m_s2: Vector = _ZERO
    rotor_speeds: PerRotor = (0.0, 0.0, 0.0, 0.0)
    airborne: bool = True

    @property
    def acceleration_flu_m_s2(self) -> Vector:
        """The acceleration in the body's axes, FLU."""
        w, x, y, z = self.attitude
        return earth_from_body((w, -x, -y, -z), self.acceleration_enu_m_s2)


AT_REST = VehicleState(_ZERO, _ZERO, (1.0, 0.0, 0.0, 0.0), _ZERO, _ZERO)  # hovering at the origin, level, heading east


def still_horizon(samples: int) -> Horizon:
    vectors, scalars = np.zeros((samples, 3)), np.zeros(samples)
    return Horizon(vectors, vectors, vectors, vectors, vectors, scalars, scalars, scalars)


class Fallback(StrEnum):
    """Source of a decision without a solved QP."""

    SHIFTED_PLAN = "shifted plan"
    LQR = "LQR"
    DESCENT = "level and descend"
    RECOVERY = "recovery"
    THREE_ROTORS = "three rotors"


# In logs and telemetry: 0 is solved, -1 without a QP or fallback.
STATUS_CODES: dict[QpStatus | None, int] = {None: -1} | {status: code for code, status in enumerate(QpStatus)}
FALLBACK_CODES: dict[Fallback | None, int] = {None: -1} | {fallback: code for code, fallback in enumerate(Fallback)}


class Active(NamedTuple):
    """Numbers of active constraints at the solution, by kind."""

    rotors: int = 0
    increments: int = 0
    angles: int = 0
    rates: int = 0


class PlanColumns(NamedTuple):
    """Columns of the attitude in the predicted outputs of a control law."""

    phi: int  # rad
    theta: int  # rad
    psi: int  # rad, unwrapped
    yaw_rate: int  # body rate r, rad/s


class Diagnostics(NamedTuple):
    """Details of a decision; a control law without a QP leaves the defaults.

    Attributes:
        qp_status: Result of the QP.
        fallback: Source of the decision if the QP was not solved.
        solve_time_s: Duration of the QP's solution, and of reading the LPV-MPC's plan from it.
        cost: The QP's objective.
        active: Active constraints at the solution.
        slack: Largest violation of a soft limit, in parts of it.
        predicted: Outputs over the horizon, (N, p); order and units by the control law.
        planned_squared: Squared rotor speeds at each step, in parts of the largest, (N, 4).
        mass_kg: Estimated mass; nan without an estimate.
        path_lag_s: Lag of path time behind the clock; nan by the clock.
        qp_iterations: Iterations of the QP solver, 0 if none was needed; nan if unknown.
    """

    qp_status: QpStatus | None = None
    fallback: Fallback | None = None
    solve_time_s: float = 0.0
    cost: float = 0.0
    active: Active = Active()
    slack: float = 0.0
    predicted: Array | None = None
    planned_squared: Array | None = None
    mass_kg: float = nan
    path_lag_s: float = nan
    qp_iterations: float = nan


class Decision(NamedTuple):
    """A control law's decision.

    Attributes:
        rotor_speeds: In the vehicle's unit and rotor order, within its limits, (rotors,).
        attitude_reference: Commanded phi, theta, psi, rad.
    """

    rotor_speeds: Array
    attitude_reference: Vector
    diagnostics: Diagnostics = Diagnostics()


@runtime_checkable
class Controller(Protocol[Memory]):
    """A control law.

    Attributes:
        control_interval_us: Time between two control samples: whole milliseconds.
    """

    control_interval_us: int
    preview: Preview

    def initial(self, rotor_speed: float) -> Memory:
        """Return the memory before the first sample, every rotor at `rotor_speed` (vehicle's unit)."""

    def step(self, memory: Memory, time_us: int, state: VehicleState, references: Horizon) -> tuple[Memory, Decision]:
        """Decide the rotor speeds to hold until the next control sample.

        Args:
            time_us: Simulated time, µs, a multiple of the control interval.
            state: At the time the decision takes effect: now, unless a delay is compensated.
            references: By `preview`, from that time on; shared, so read only.
        """


@runtime_checkable
class AttitudeController(Controller[Memory], Protocol[Memory]):
    """A control law that can also track an attitude, as some modes require.

    A flight may switch between both steps at any sample. Attitudes tilt by up to 60°, or without limit if the law has
    `tilts_freely = True`.
    """

    def step_attitude(
        self, memory: Memory, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[Memory, Decision]:
        """Decide as `step` does, for a demand at the samples of `preview`."""


@runtime_checkable
class ChargeController(Controller[Memory], Protocol[Memory]):
    """A control law that estimates the charge taken from the battery, Ah; optional.

    The estimate survives a restart in flight.
    """

    def charge_ah(self, memory: Memory) -> float: ...

    def with_charge(self, memory: Memory, charge_ah: float) -> Memory: ...


@runtime_checkable
class MassController(Controller[Memory], Protocol[Memory]):
    """A control law that estimates the vehicle's mass in flight; optional.

    The estimate survives a restart in flight, but not a landing.
    """

    def mass_kg(self, memory: Memory) -> float: ...

    def with_mass(self, memory: Memory, mass_kg: float) -> Memory: ...


class Pace(Enum):
    """Progress of time along the references."""

    CLOCK = "clock"
    WAITING = "waiting"  # slower where the vehicle cannot follow
    CATCHING_UP = "catching up"  # slower there, then faster until the lag is made up


@runtime_checkable
class PathController(Controller[Memory], Protocol[Memory]):
    """A control law that can choose its speed along the references; optional.

    Attributes:
        min_path_speed: Least speed, in parts of the references'; 1 stands for the clock.
    """

    min_path_speed: float

    def step_on_path(
        self, memory: Memory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[Memory, Decision]:
        """Decide as `step` does for references by path time, and choose the speed."""

    def path_speed(self, memory: Memory) -> float: ...

    def lag_us(self, memory: Memory) -> int:
        """Return the lag of path time behind the clock, µs, at least 0."""

    def with_lag(self, memory: Memory, lag_us: int) -> Memory: ...


@runtime_checkable
class PlanController(Controller[Memory], Protocol[Memory]):
    """A control law that plans attitudes and thrusts over its horizon; optional.

    Its diagnostics hold `predicted` and `planned_squared` from now on at control samples.
    """

    plan_columns: PlanColumns


@runtime_checkable
class QuietController(PlanController[Memory], Protocol[Memory]):
    """A control law that can leave its plan out of the diagnostics, to save time; optional.

    Attributes:
        shows_plan: False where nobody reads `predicted` and `planned_squared`.
    """

    shows_plan: bool


@runtime_checkable
class CompiledController(Controller[Memory], Protocol[Memory]):
    """A control law with compiled parts, loaded before the flight; optional."""

    def warm_up(self) -> None: ...
