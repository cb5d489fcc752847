"""The vehicle as its telemetry sees it at one instant: plain values in SI, ENU and FLU."""

from collections.abc import Mapping
from math import nan
from types import MappingProxyType
from typing import Any, NamedTuple

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic
from colibri.common.types import FourRotors, Quaternion, Vector
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame

NOWHERE: Vector = (nan, nan, nan)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
CHARGE_OK = 1
"""MAV_BATTERY_CHARGE_STATE_OK."""


class Home(NamedTuple):
    """Where the vehicle returns to; yaw is counter-clockwise from east."""

    position_enu_m: Vector
    yaw_rad: float


class BatteryState(NamedTuple):
    """The battery, as the autopilot estimates it.

    Attributes:
        remaining: Part of the charge that is left, 0..1.
        remaining_s: Time until it is empty at this current; nan while none flows.
        charge_state: MAV_BATTERY_CHARGE_STATE.
    """

    cells: int
    voltage_v: float
    current_a: float
    used_ah: float
    remaining: float
    remaining_s: float
    used_wh: float
    charge_state: int = CHARGE_OK


class Setpoint(NamedTuple):
    """What the control law steers to now; nan where it steers to nothing.

    Attributes:
        yaw_rad: Counter-clockwise from east.
        thrust: Part of the largest, 0..1.
    """

    position_enu_m: Vector = NOWHERE
    velocity_enu_m_s: Vector = NOWHERE
    acceleration_enu_m_s2: Vector = NOWHERE
    yaw_rad: float = nan
    yaw_rate_rad_s: float = nan
    attitude: Quaternion = LEVEL
    rate_flu_rad_s: Vector = (0.0, 0.0, 0.0)
    thrust: float = 0.0


class Forecast(NamedTuple):
    """A point of the predicted horizon; yaw is counter-clockwise from east."""

    after_s: float
    position_enu_m: Vector
    velocity_enu_m_s: Vector
    acceleration_enu_m_s2: Vector
    yaw_rad: float
    yaw_rate_rad_s: float


class SolverState(NamedTuple):
    """How the control law's last decision came about.

    Attributes:
        status: Code of `colibri.autopilot.control.qp.QpStatus`, 0 is solved; -1 without a QP.
        fallback: Code of `colibri.autopilot.control.interface.Fallback`; -1 is none.
        iterations: Of the solver; -1 where it reports none.
        slack: By how much soft limits are exceeded, in parts of each: the largest.
        active: Constraints that bind: rotors, increments, angles, rates.
        planned_squared: Squared rotor speeds of the plan's steps, parts of the largest.
        mass_kg: That the vehicle moves like; nan where the control law estimates none.
        path_lag_s: By which the path time is behind the clock; nan where the control law keeps to the clock.
    """

    status: int = -1
    fallback: int = -1
    iterations: int = -1
    solve_time_s: float = 0.0
    step_time_s: float = 0.0
    cost: float = 0.0
    slack: float = 0.0
    active: tuple[int, int, int, int] = (0, 0, 0, 0)
    planned_squared: tuple[FourRotors, ...] = ()
    horizon: tuple[Forecast, ...] = ()
    mass_kg: float = nan
    path_lag_s: float = nan


class EstimatorState(NamedTuple):
    """How well the vehicle knows its state.

    Attributes:
        flags: ESTIMATOR_STATUS_FLAGS.
        ratios: Of the last tests of velocity, horizontal position, height, magnetic field, height above the ground and
            airspeed: above 1 one was rejected.
        sensors: MAV_SYS_STATUS_SENSOR bits of those that it reads.
        failed_sensors: MAV_SYS_STATUS_SENSOR bits of those that are rejected.
    """

    flags: int
    ratios: tuple[float, ...]
    horizontal_accuracy_m: float
    vertical_accuracy_m: float
    sensors: int
    failed_sensors: int


NO_SETPOINT = Setpoint()
NOT_SOLVED = SolverState()


class Snapshot(NamedTuple):
    """Everything that telemetry sends.

    Attributes:
        time_us: Simulated time since the autopilot began, µs.
        armed: Whether the rotors may turn.
        base_mode: MAV_MODE_FLAG bits of the HEARTBEAT, but for the armed one.
        custom_mode: The mode in the layout of the identity that is flown under.
        intended_custom_mode: What was last asked for.
        standard_mode: MAV_STANDARD_MODE of the mode, 0 where it is none.
        landed_state: MAV_LANDED_STATE.
        failsafe: Whether the vehicle acts on its own to save itself.
        emergency: Whether it comes down for that.
        armable: Whether every check before arming passes.
        attitude: Unit quaternion, FLU to ENU.
        rotor_speeds_rad_s: As the autopilot estimates them.
        controls: Commanded, parts of the largest speed.
        delay_us: Of commands, compensated.
        sticks: Of the last MANUAL_CONTROL: pitch, roll, thrust, yaw, -1..1 (thrust 0..1); None without one.
        flight_started_us, takeoff_us, landing_us: Of the last arming, take-off and landing; 0 before.
        ground_m: Height of the ground below, over the origin.
        target_enu_m: Where the way leads, the next waypoint; nan for the setpoint itself.
        fence_breached: Whether the vehicle is where it must not be.
        load: Part of the time between two frames that the autopilot computes, 0..1.
        sensed: What was measured on board last; None with state feedback.
        latest: The last value of each sensor with a message of its own, by the field of `SensorFrame`.
        estimator: How well the state is known; None with state feedback.
    """

    time_us: int
    armed: bool = False
    base_mode: int = 0
    custom_mode: int = 0
    intended_custom_mode: int = 0
    standard_mode: int = 0
    landed_state: int = 1
    failsafe: bool = False
    emergency: bool = False
    armable: bool = True
    position_enu_m: Vector = (0.0, 0.0, 0.0)
    velocity_enu_m_s: Vector = (0.0, 0.0, 0.0)
    acceleration_enu_m_s2: Vector = (0.0, 0.0, 0.0)
    attitude: Quaternion = LEVEL
    rate_flu_rad_s: Vector = (0.0, 0.0, 0.0)
    origin: Geodetic = DEFAULT_ORIGIN
    home: Home | None = None
    rotor_speeds_rad_s: FourRotors = (0.0, 0.0, 0.0, 0.0)
    controls: FourRotors = (0.0, 0.0, 0.0, 0.0)
    battery: BatteryState | None = None
    setpoint: Setpoint = NO_SETPOINT
    solver: SolverState = NOT_SOLVED
    wind_enu_m_s: Vector = NOWHERE
    delay_us: int = 0
    sticks: FourRotors | None = None
    flight_started_us: int = 0
    takeoff_us: int = 0
    landing_us: int = 0
    flights: int = 0
    terminated: bool = False
    ground_m: float = 0.0
    target_enu_m: Vector = NOWHERE
    gps_ok: bool = True
    fence_enabled: bool = False
    fence_breached: bool = False
    load: float = 0.0
    sensed: SensorFrame | None = None
    fix: GpsFix | None = None
    latest: Mapping[str, Any] = MappingProxyType({})
    estimator: EstimatorState | None = None
