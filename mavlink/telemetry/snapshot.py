"""The vehicle's state for telemetry at one instant, in SI, ENU and FLU."""

from collections.abc import Mapping
from math import hypot, isfinite, nan
from types import MappingProxyType
from typing import Any, NamedTuple

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, geodetic_of
from colibri.common.records import Record
from colibri.common.types import PerRotor, Quaternion, Vector
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame
from colibri.mavlink.wire.ned import frd_from_flu, ned_from_enu

NOWHERE: Vector = (nan, nan, nan)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
CHARGE_OK = 1  # MAV_BATTERY_CHARGE_STATE_OK


class HomePosition(Record, frozen=True):
    position_enu_m: Vector
    yaw_rad: float  # counter-clockwise from east


class BatteryState(Record, frozen=True):
    cells: int
    voltage_v: float
    current_a: float
    used_ah: float
    remaining: float  # 0..1
    remaining_s: float  # at this current; nan if none flows
    used_wh: float
    charge_state: int = CHARGE_OK  # MAV_BATTERY_CHARGE_STATE


class Setpoint(Record, frozen=True):
    """The control law's setpoint; nan if not given."""

    position_enu_m: Vector = NOWHERE
    velocity_enu_m_s: Vector = NOWHERE
    acceleration_enu_m_s2: Vector = NOWHERE
    yaw_rad: float = nan  # counter-clockwise from east
    yaw_rate_rad_s: float = nan
    attitude: Quaternion = LEVEL
    rate_flu_rad_s: Vector = (0.0, 0.0, 0.0)
    thrust: float = 0.0  # 0..1 of the largest


class Forecast(NamedTuple):
    """A point of the predicted horizon; yaw is counter-clockwise from east."""

    after_s: float
    position_enu_m: Vector
    velocity_enu_m_s: Vector
    acceleration_enu_m_s2: Vector
    yaw_rad: float
    yaw_rate_rad_s: float


class SolverState(Record, frozen=True):
    status: int = -1  # `QpStatus`, 0 is solved; -1 without a QP
    fallback: int = -1  # `Fallback`; -1 without
    iterations: int = -1  # -1 if not reported
    solve_time_s: float = 0.0
    step_time_s: float = 0.0
    cost: float = 0.0
    slack: float = 0.0  # largest excess of a soft limit, in parts of it
    active: tuple[int, int, int, int] = (0, 0, 0, 0)  # constraints: rotors, increments, angles, rates
    planned_squared: tuple[PerRotor, ...] = ()  # parts of the largest, by step
    horizon: tuple[Forecast, ...] = ()
    mass_kg: float = nan  # nan for a law without an estimate
    path_lag_s: float = nan  # nan for a law that follows the clock


class EstimatorState(NamedTuple):
    flags: int  # ESTIMATOR_STATUS_FLAGS
    ratios: tuple[float, ...]  # of tests, in the order of ESTIMATOR_STATUS; rejected above 1
    horizontal_accuracy_m: float
    vertical_accuracy_m: float
    sensors: int  # MAV_SYS_STATUS_SENSOR bits
    failed_sensors: int  # likewise


NO_SETPOINT = Setpoint()
NOT_SOLVED = SolverState()


_PLUS = ((0.0, -0.5, 0.0, 0.5), (0.5, 0.0, -0.5, 0.0), (0.5, -0.5, 0.5, -0.5))


class TelemetrySnapshot(Record, frozen=True):
    time_us: int  # simulated, since the autopilot's start
    armed: bool = False
    base_mode: int = 0  # MAV_MODE_FLAG bits except the armed one
    custom_mode: int = 0  # in the identity's layout
    intended_custom_mode: int = 0  # last requested
    standard_mode: int = 0  # MAV_STANDARD_MODE or 0
    px4_mode: int = 0  # in PX4's layout, for logs
    landed_state: int = 1  # MAV_LANDED_STATE
    failsafe: bool = False  # acting on a failsafe
    emergency: bool = False  # descending for it
    armable: bool = True  # all arming checks pass
    position_enu_m: Vector = (0.0, 0.0, 0.0)
    velocity_enu_m_s: Vector = (0.0, 0.0, 0.0)
    acceleration_enu_m_s2: Vector = (0.0, 0.0, 0.0)
    attitude: Quaternion = LEVEL  # FLU to ENU
    rate_flu_rad_s: Vector = (0.0, 0.0, 0.0)
    origin: Geodetic = DEFAULT_ORIGIN
    home: HomePosition | None = None
    rotor_speeds_rad_s: PerRotor = (0.0, 0.0, 0.0, 0.0)  # estimated
    controls: PerRotor = (0.0, 0.0, 0.0, 0.0)  # commanded, parts of the largest
    levers: tuple[PerRotor, PerRotor, PerRotor] = _PLUS  # of roll, pitch, yaw (FRD) by the controls, -1 to 1
    battery: BatteryState | None = None
    setpoint: Setpoint = NO_SETPOINT
    solver: SolverState = NOT_SOLVED
    wind_enu_m_s: Vector = NOWHERE
    delay_us: int = 0  # compensated delay of commands
    sticks: tuple[float, float, float, float] | None = None  # of MANUAL_CONTROL: pitch, roll, thrust, yaw
    flight_started_us: int = 0  # last arming; 0 before, as the next two
    takeoff_us: int = 0
    landing_us: int = 0
    flights: int = 0
    terminated: bool = False
    ground_m: float = 0.0  # ground height above the origin
    target_enu_m: Vector = NOWHERE  # next waypoint; nan for the setpoint itself
    gps_ok: bool = True
    fence_enabled: bool = False
    fence_breached: bool = False
    fence_breaches: int = 0  # so far, with FENCE_BREACH and time of the last one
    fence_breach_type: int = 0
    fence_breached_us: int = 0
    channels: tuple[int, ...] = ()  # of the radio, us
    requested: Setpoint | None = None  # by a client in ArduPilot's GUIDED; without attitude
    load: float = 0.0  # computing time, part of the frame interval
    sensed: SensorFrame | None = None  # None under state feedback
    fix: GpsFix | None = None
    latest: Mapping[str, Any] = MappingProxyType({})  # last values of own-message sensors, by field of `SensorFrame`
    estimator: EstimatorState | None = None  # None under state feedback

    @property
    def boot_ms(self) -> int:
        return self.time_us // 1000 % 2**32

    @property
    def place(self) -> Geodetic:
        return geodetic_of(self.position_enu_m, self.origin)

    @property
    def height_above_home_m(self) -> float:
        return self.position_enu_m[2] - (self.home.position_enu_m[2] if self.home else 0.0)

    @property
    def velocity_ned_cm_s(self) -> Vector:
        north, east, down = ned_from_enu(self.velocity_enu_m_s)
        return (100.0 * north, 100.0 * east, 100.0 * down)

    @property
    def rate_frd(self) -> Vector:
        return frd_from_flu(self.rate_flu_rad_s)

    @property
    def airspeed_m_s(self) -> float:
        wind = self.wind_enu_m_s if all(map(isfinite, self.wind_enu_m_s)) else (0.0, 0.0, 0.0)
        return hypot(*(own - air for own, air in zip(self.velocity_enu_m_s, wind, strict=True)))
