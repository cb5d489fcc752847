"""The interface of a control law, and where control laws are found.

A control law is a class that a package registers under the entry point group `colibri.controllers`. Its instances are
given the vehicle's state and the references ahead once a control sample, and return the rotor speeds to hold until the
next. What they remember they return too: a controller has no state of its own, so the same inputs give the same flight.
"""

from collections.abc import Callable
from enum import Enum, StrEnum
from math import nan
from typing import NamedTuple, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np

from colibri.autopilot.control.qp import QpStatus
from colibri.common.types import Array, Quaternion, Vector

Clock: TypeAlias = Callable[[], float]
"""Returns seconds. A control law may measure itself with it; it must decide nothing by it."""
Memory = TypeVar("Memory")


class Preview(NamedTuple):
    """Which references a control law wants at each control sample.

    Attributes:
        interval_us: Time between two references, µs. The first is that of the interval that now lies in.
        samples: How many.
    """

    interval_us: int
    samples: int


class Horizon(NamedTuple):
    """References from now on, at the preview's interval.

    Attributes:
        position_enu_m, velocity_enu_m_s: (n, 3) each, ENU.
        acceleration_enu_m_s2, jerk_enu_m_s3, snap_enu_m_s4: (n, 3) each, ENU; zero where planned by differences.
        yaw_rad: (n,), rad, counter-clockwise from east, unwrapped.
        yaw_rate_rad_s: (n,), rad/s; zero where planned by differences, or where yaw is held for want of a direction.
        yaw_acceleration_rad_s2: (n,), rad/s²; zero where planned by differences, or where yaw is held.
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
    """An attitude to hold and a thrust to make, from now on, at the preview's interval.

    Attributes:
        angles: phi, theta, psi, rad, psi unwrapped, (n, 3).
        angle_rates_rad_s: Their derivatives, (n, 3).
        thrust_n: Along the body's z axis, N, (n,).
    """

    angles: Array
    angle_rates_rad_s: Array
    thrust_n: Array


class VehicleState(NamedTuple):
    """The vehicle's state as a control law takes it.

    Attributes:
        position_enu_m, velocity_enu_m_s: m and m/s, ENU.
        attitude: Unit quaternion wxyz, FLU body to ENU earth.
        euler: phi, theta, psi in rad, psi unwrapped.
        rate_flu_rad_s: Body rates p, q, r, rad/s, FLU.
        airborne: Whether nothing but air and rotors acts on it: it is clear of the ground.
    """

    position_enu_m: Vector
    velocity_enu_m_s: Vector
    attitude: Quaternion
    euler: Vector
    rate_flu_rad_s: Vector
    airborne: bool = True


_ZERO = (0.0, 0.0, 0.0)
AT_REST = VehicleState(_ZERO, _ZERO, (1.0, 0.0, 0.0, 0.0), _ZERO, _ZERO)
"""A vehicle that hovers at the origin, level, heading east."""


def still_horizon(samples: int) -> Horizon:
    """Return references that stay where `AT_REST` is."""
    vectors, scalars = np.zeros((samples, 3)), np.zeros(samples)
    return Horizon(vectors, vectors, vectors, vectors, vectors, scalars, scalars, scalars)


class Fallback(StrEnum):
    """What decided in place of a solved QP."""

    SHIFTED_PLAN = "shifted plan"
    LQR = "LQR"
    DESCENT = "level and descend"
    RECOVERY = "recovery"
    THREE_ROTORS = "three rotors"


STATUS_CODES: dict[QpStatus | None, int] = {None: -1} | {status: code for code, status in enumerate(QpStatus)}
"""How logs and telemetry write the status of a QP: 0 is solved, -1 no QP."""
FALLBACK_CODES: dict[Fallback | None, int] = {None: -1} | {fallback: code for code, fallback in enumerate(Fallback)}
"""How they write a fallback: -1 is none."""


class Active(NamedTuple):
    """How many constraints of each kind bind at the solution."""

    rotors: int = 0
    increments: int = 0
    angles: int = 0
    rates: int = 0


class PlanColumns(NamedTuple):
    """Where the predicted outputs of a control law hold the attitude.

    Attributes:
        phi, theta, psi: Columns of roll, pitch and yaw (unwrapped), rad.
        yaw_rate: Column of the body rate r, rad/s.
    """

    phi: int
    theta: int
    psi: int
    yaw_rate: int


class Diagnostics(NamedTuple):
    """How a decision came about; a control law without a QP leaves the defaults.

    Attributes:
        qp_status: How the QP ended; None if there was none.
        fallback: What decided in its place; None if it was solved, or there was none.
        solve_time_s: Time that the QP took, s.
        cost: The QP's objective at its solution.
        active: Constraints that bind at the solution.
        slack: By how much soft limits are exceeded, in parts of each: the largest.
        predicted: Outputs predicted over the horizon, (N, p), in the order and units that the control law documents.
        planned_squared: Squared rotor speeds that the plan commands at each step, in parts of the largest, (N, 4).
        mass_kg: Mass that the vehicle moves like under its thrust; nan for a control law that estimates none.
        path_lag_s: By which the law's path time was behind the clock; nan for a control law that keeps to the clock.
        qp_iterations: That the QP's solver took, 0 where none was asked; nan if there was no QP, or it does not say.
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
    """What a control law decided.

    Attributes:
        rotor_speeds: In the vehicle's unit and rotor order, within its limits, (4,).
        attitude_reference: phi, theta, psi that the attitude is steered to, rad.
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
        """Return what the law remembers before its first sample, every rotor at `rotor_speed` (vehicle's unit)."""

    def step(self, memory: Memory, time_us: int, state: VehicleState, references: Horizon) -> tuple[Memory, Decision]:
        """Decide the rotor speeds to hold until the next control sample.

        Args:
            memory: What the step before returned.
            time_us: Simulated time, µs, a multiple of the control interval.
            state: The vehicle when the decision takes effect: now, unless a delay is compensated.
            references: Those of `preview`, from that instant on; shared, so not to be written to.
        """


@runtime_checkable
class AttitudeController(Controller[Memory], Protocol[Memory]):
    """A control law that can also take an attitude; one that cannot simply flies no mode that needs it.

    Its two ways to decide share what they remember: a flight may change between them at any sample.
    """

    def step_attitude(
        self, memory: Memory, time_us: int, state: VehicleState, demand: AttitudeDemand
    ) -> tuple[Memory, Decision]:
        """Decide as `step` does, for a demand at the samples of `preview`; `memory` is of a step of either kind."""


@runtime_checkable
class ChargeController(Controller[Memory], Protocol[Memory]):
    """A control law that counts what its battery gives; optional.

    A law that has this goes on with the charge that is left where it restarts in mid-flight, and with what the
    battery itself reports, where it does.
    """

    def charge_ah(self, memory: Memory) -> float:
        """Return the charge that the law remembers as taken from its battery, Ah."""

    def with_charge(self, memory: Memory, charge_ah: float) -> Memory:
        """Return the memory with another charge taken from the battery, Ah."""


@runtime_checkable
class MassController(Controller[Memory], Protocol[Memory]):
    """A control law that estimates its vehicle's mass in flight; optional.

    A law that has this goes on with the mass that it has estimated where it restarts in mid-flight. Each take-off
    begins with the vehicle's own: what was carried may have been left on the ground.
    """

    def mass_kg(self, memory: Memory) -> float:
        """Return the mass that the law remembers, kg."""

    def with_mass(self, memory: Memory, mass_kg: float) -> Memory:
        """Return the memory with another mass, kg."""


class Pace(Enum):
    """How time passes along references, where a control law leaves the choice."""

    CLOCK = "clock"
    """As on the clock."""
    WAITING = "waiting"
    """More slowly where the vehicle cannot follow."""
    CATCHING_UP = "catching up"
    """So, and later faster, until what was lost is made up for."""


@runtime_checkable
class PathController(Controller[Memory], Protocol[Memory]):
    """A control law that can fly along references at a speed of its own; optional.

    Where it does, the references that it is given are those of path time, which lags behind the clock. `step` keeps to
    the clock, with no lag.

    Attributes:
        min_path_speed: The least speed, in parts of the references' own; a law with 1 is not asked to.
    """

    min_path_speed: float

    def step_on_path(
        self, memory: Memory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[Memory, Decision]:
        """Decide as `step` does, and how fast to go on along the references, which begin at path time."""

    def path_speed(self, memory: Memory) -> float:
        """Return the speed along the references, in parts of their own; 1 on the clock."""

    def lag_us(self, memory: Memory) -> int:
        """Return by how much path time lags behind the clock, µs, at least 0: what the law may make up for."""

    def with_lag(self, memory: Memory, lag_us: int) -> Memory:
        """Return the memory with another lag, µs."""


@runtime_checkable
class PlanController(Controller[Memory], Protocol[Memory]):
    """A control law that plans attitudes and thrusts over its horizon; optional.

    Ground stations are shown where its plan leads: its diagnostics hold `predicted` with the attitude in these columns,
    a control sample apart from now on, and `planned_squared`.

    Attributes:
        plan_columns: Where `predicted` holds the attitude.
    """

    plan_columns: PlanColumns


@runtime_checkable
class CompiledController(Controller[Memory], Protocol[Memory]):
    """A control law with compiled parts, which the process loads before it flies; optional.

    A law that is built again for other parameters finds them loaded.
    """

    def warm_up(self) -> None:
        """Load what is compiled."""
