"""Flight stacks as values, thrust in SET_ATTITUDE_TARGET, and the file `companion.toml` of an identified response.

Sources: PX4 guide, Offboard Mode; PX4 Parameter Reference. ArduPilot, Copter Commands in Guided Mode; Copter
parameters; AP_Motors_Thrust_Linearization.cpp.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from math import sqrt
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias

import msgspec

from colibri.common.config import UNREADABLE, NotNegative, Positive, Table
from colibri.common.errors import Error
from colibri.common.files import read_text
from colibri.mavlink.client.modes import COPTER_MODES, PX4_MODES, FlightMode
from colibri.mavlink.services.identity import PRODUCT
from colibri.mavlink.wire.dialect import AUTOPILOT_GENERIC, mav
from colibri.plant.vehicle.description import Vehicle


class CompanionError(Error):
    """The companion cannot begin with its input."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrustCurve:
    """Thrust convention of PX4 and ArduPilot, whose `hover` carries the weight.

    A command u becomes x with u = (1 - expo) x + expo x², and x a motor signal between `spin_min` and `spin_max`.
    Thrust is proportional to the signal, or to its square if the signal is a rotor speed.
    """

    hover: float
    expo: float = 0.0
    spin_min: float = 0.0
    spin_max: float = 1.0
    quadratic: bool = True

    def command(self, load: float) -> float:
        """Convert a thrust, in weights, to a command, 0..1."""
        hover = self._signal(self.hover)
        signal = hover * sqrt(max(load, 0.0)) if self.quadratic else hover * max(load, 0.0)
        x = min(max((signal - self.spin_min) / (self.spin_max - self.spin_min), 0.0), 1.0)
        return (1.0 - self.expo) * x + self.expo * x * x

    def load(self, command: float) -> float:
        """Convert a command, 0..1, to a thrust in weights."""
        ratio = self._signal(min(max(command, 0.0), 1.0)) / self._signal(self.hover)
        return ratio * ratio if self.quadratic else ratio

    def _signal(self, command: float) -> float:
        linear = 1.0 - self.expo
        x = 2.0 * command / (linear + sqrt(linear * linear + 4.0 * self.expo * command)) if command > 0.0 else 0.0
        return self.spin_min + (self.spin_max - self.spin_min) * x


@dataclass(frozen=True, slots=True, kw_only=True)
class MiddleHovers:
    """Colibri's offboard mode: 0.5 carries the weight, 1 `max_load` weights."""

    max_load: float
    hover: float = 0.5

    def command(self, load: float) -> float:
        if load <= 1.0:
            return 0.5 * max(load, 0.0)
        return min(0.5 + 0.5 * (load - 1.0) / (self.max_load - 1.0), 1.0)

    def load(self, command: float) -> float:
        if command <= self.hover:
            return 2.0 * max(command, 0.0)
        return 1.0 + (min(command, 1.0) - 0.5) * 2.0 * (self.max_load - 1.0)


Thrust = ThrustCurve | MiddleHovers
Parameters: TypeAlias = Mapping[str, float]
"""Parameters of the vehicle, by name."""

MAX_STALE_S = 0.3  # longest use of the last body rates after a companion falls silent
ROUNDING = 1e-6  # of single precision on the wire


class TakeOffOrder(Enum):
    COMMAND_THEN_ARM = "take-off, then arm: the height is above the sea"
    ARM_THEN_COMMAND = "guided mode, arm, take-off: the height is above home"


class ParameterRule(NamedTuple):
    """A test of a parameter, with advice for a failure."""

    name: str
    right: Callable[[float], bool]
    action: str


TimeConstant: TypeAlias = Annotated[float, msgspec.Meta(ge=0.005, le=1.0)]
Scale: TypeAlias = Annotated[float, msgspec.Meta(ge=0.5, le=1.8)]
Lag: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=0.5)]
Latency: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=0.2)]


class Response(Table, frozen=True, forbid_unknown_fields=True):
    """Response of body rates and thrust; a time constant too long costs stability, one too short only bandwidth."""

    # the rate loop demands the acceleration (command - rate) / time constant
    time_constant_s: tuple[TimeConstant, TimeConstant, TimeConstant]
    latency_s: Latency  # from a command's arrival to its first effect
    thrust_lag_s: NotNegative
    max_rate_rad_s: tuple[Positive, Positive, Positive]  # limit in the stack
    max_acceleration_rad_s2: tuple[Positive, Positive, Positive]  # limit in the stack
    acceleration_lag_s: tuple[Lag, Lag, Lag] = (0.0, 0.0, 0.0)  # 0 for first order


class ResponseFile(Response, frozen=True, forbid_unknown_fields=True, kw_only=True):
    thrust_scale: Scale = 1.0  # actual thrust over the thrust derived from the vehicle's parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack:
    name: str
    autopilot: int
    offboard: FlightMode
    hold: FlightMode
    last_resort: FlightMode
    steady: frozenset[int]  # `custom_mode` of modes that permit a take-over
    streams: Mapping[str, float]  # rates of requested messages, Hz
    needed: tuple[str, ...]  # parameters required to fly; `optional` ones may not exist
    optional: tuple[str, ...]
    rules: tuple[ParameterRule, ...]
    fence: tuple[str, str]  # parameters of the fence's radius and height, m; 0 disables it
    thrust: Callable[[Parameters, Vehicle], Thrust]
    response: Response
    take_off: TakeOffOrder
    integers_by_bits: bool  # integer parameters travel bytewise

    @property
    def parameters(self) -> tuple[str, ...]:
        return (*self.needed, *self.optional, *self.fence)


OFFBOARD, HOLD, LAND = PX4_MODES["Offboard"], PX4_MODES["Hold"], PX4_MODES["Land"]
_GUIDED, _LOITER, _COPTER_LAND, _BRAKE = (COPTER_MODES[name] for name in ("Guided", "Loiter", "Land", "Brake"))
_THRUST_AS_THRUST = 8  # bit 3 of GUID_OPTIONS; without it a thrust is a climb rate
_STATUS_HZ = {"EXTENDED_SYS_STATE": 5.0, "SYS_STATUS": 5.0, "BATTERY_STATUS": 1.0, "GLOBAL_POSITION_INT": 5.0}
_PX4_STATUS_HZ = {"CURRENT_MODE": 25.0, "ESTIMATOR_STATUS": 5.0, **_STATUS_HZ}


def _curve(numbers: Mapping[str, tuple[str, float]]) -> Callable[[Parameters, Vehicle], ThrustCurve]:

    def thrust(parameters: Parameters, vehicle: Vehicle) -> ThrustCurve:
        found = {number: parameters.get(name, default) for number, (name, default) in numbers.items()}
        return ThrustCurve(**found, quadratic=vehicle.rotors.control == "speed")

    return thrust


def _times_out(name: str, stack: str) -> ParameterRule:
    action = f"set {name} to {MAX_STALE_S:g}: {stack} follows the last body rates for as long"
    return ParameterRule(name, lambda value: value <= MAX_STALE_S + ROUNDING, action)


PX4 = Stack(
    name="px4",
    autopilot=mav.MAV_AUTOPILOT_PX4,
    offboard=OFFBOARD,
    hold=HOLD,
    last_resort=LAND,
    steady=frozenset({HOLD.custom, PX4_MODES["Takeoff"].custom}),
    streams={"ODOMETRY": 100.0, "ATTITUDE_QUATERNION": 50.0, "LOCAL_POSITION_NED": 50.0, **_PX4_STATUS_HZ},
    needed=("MPC_THR_HOVER", "THR_MDL_FAC", "COM_OF_LOSS_T"),
    optional=("COM_RC_OVERRIDE",),
    rules=(_times_out("COM_OF_LOSS_T", "PX4"),),
    fence=("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
    thrust=_curve({"hover": ("MPC_THR_HOVER", 0.5), "expo": ("THR_MDL_FAC", 0.0)}),
    response=Response((0.055, 0.055, 0.3), 0.04, 0.04, (3.8, 3.8, 2.0), (12.0, 12.0, 6.0)),
    take_off=TakeOffOrder.COMMAND_THEN_ARM,
    integers_by_bits=True,
)
_ARDUPILOT_CURVE = {
    "hover": ("MOT_THST_HOVER", 0.35),
    "expo": ("MOT_THST_EXPO", 0.65),
    "spin_min": ("MOT_SPIN_MIN", 0.15),
    "spin_max": ("MOT_SPIN_MAX", 0.95),
}
ARDUPILOT = Stack(
    name="ardupilot",
    autopilot=mav.MAV_AUTOPILOT_ARDUPILOTMEGA,
    offboard=_GUIDED,
    hold=_LOITER,
    last_resort=_COPTER_LAND,
    steady=frozenset({_LOITER.custom, _BRAKE.custom}),
    streams={"ATTITUDE_QUATERNION": 100.0, "LOCAL_POSITION_NED": 100.0, "HEARTBEAT": 25.0, **_STATUS_HZ},
    needed=(*(name for name, _ in _ARDUPILOT_CURVE.values()), "GUID_OPTIONS", "GUID_TIMEOUT"),
    optional=("FENCE_ENABLE",),
    rules=(
        ParameterRule(
            "GUID_OPTIONS",
            lambda value: bool(int(value) & _THRUST_AS_THRUST),
            "add 8 to GUID_OPTIONS: a thrust is to be a thrust, not a climb rate",
        ),
        _times_out("GUID_TIMEOUT", "ArduPilot"),
    ),
    fence=("FENCE_RADIUS", "FENCE_ALT_MAX"),
    thrust=_curve(_ARDUPILOT_CURVE),
    response=Response((0.03, 0.03, 0.2), 0.026, 0.03, (3.8, 3.8, 1.5), (18.0, 18.0, 4.0)),
    take_off=TakeOffOrder.ARM_THEN_COMMAND,
    integers_by_bits=False,
)

_IDENTIFIED = Response((0.032, 0.032, 0.128), 0.010, 0.0, (4.0, 4.0, 2.0), (120.0, 120.0, 15.0), (0.014, 0.014, 0.010))
"""Result of --identify, the same for any airframe."""


def _colibri_thrust(_parameters: Parameters, vehicle: Vehicle) -> MiddleHovers:
    weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
    return MiddleHovers(max_load=float(vehicle.max_wrench()[0]) / weight_n)


COLIBRI = replace(
    PX4,
    name="colibri",
    streams={"ODOMETRY": 125.0, **_PX4_STATUS_HZ},
    needed=(),
    optional=("COM_OF_LOSS_T",),
    rules=(),
    thrust=_colibri_thrust,
    response=_IDENTIFIED,
)
STACKS: dict[str, Stack] = {stack.name: stack for stack in (PX4, ARDUPILOT, COLIBRI)}
_BY_AUTOPILOT = {PX4.autopilot: PX4, ARDUPILOT.autopilot: ARDUPILOT}


def recognised(autopilot: int, uid2: bytes) -> Stack | None:
    """Return the stack of a HEARTBEAT's `autopilot` and an AUTOPILOT_VERSION's `uid2`, if known."""
    if autopilot in (PX4.autopilot, AUTOPILOT_GENERIC) and uid2.startswith(PRODUCT):
        return COLIBRI
    return _BY_AUTOPILOT.get(autopilot)


def read_response(path: Path) -> tuple[Response, float]:
    try:
        text = read_text(path)
        found = msgspec.toml.decode(text, type=ResponseFile)
    except (OSError, UnicodeDecodeError) as error:
        raise CompanionError(f"{path}: {getattr(error, 'strerror', error)}") from error
    except UNREADABLE as error:
        raise CompanionError(f"{path}: {error}") from error
    response = Response(*(getattr(found, name) for name in Response.__struct_fields__))
    return response, found.thrust_scale


def response_text(response: Response, thrust_scale: float, remarks: list[str]) -> str:
    lines = [f"# {remark}" for remark in remarks]
    for name, value in (msgspec.structs.asdict(response) | {"thrust_scale": thrust_scale}).items():
        values = [f"{part:.4g}" for part in value] if isinstance(value, tuple) else None
        lines.append(f"{name} = [{', '.join(values)}]" if values else f"{name} = {float(value):.4g}")
    return "\n".join(lines) + "\n"
