"""Stand-ins for PX4 and ArduPilot, as far as their interfaces differ from Colibri's own vehicle.

Each has a thrust curve, a response of body rates, messages and rules of modes of its own, written down here by their
documents and not by what the companion believes of them. In every mode but the one that takes setpoints the vehicle
moves by kinematics alone: it climbs, and it holds.
"""

from dataclasses import dataclass, field
from math import exp, nan, sqrt
from typing import Any

import numpy as np

from colibri.common.rotations import normalized, rotation_matrix
from colibri.common.types import Array
from colibri.mavlink.parameters.store import ParamType
from colibri.mavlink.wire.dialect import Bits, Codec, Message, definition_of, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

STEP_US = 4_000
BOOTED_US = 3_000_000  # the clock of a vehicle began before anybody listened
GRAVITY = 9.81
_PARTS = 4
PX4_HOLD, PX4_TAKEOFF, PX4_OFFBOARD = (main << 16 | sub << 24 for main, sub in ((4, 3), (4, 2), (6, 0)))
GUIDED, LOITER, STABILIZE = 4, 5, 0
ACCEPTED, REJECTED, UNSUPPORTED, FAILED = 0, 1, 3, 4
STREAMED = ("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "EXTENDED_SYS_STATE", "SYS_STATUS", "GLOBAL_POSITION_INT")
_NO_COVARIANCE = (nan,) + (0.0,) * 20


@dataclass(kw_only=True)
class Numbers:
    """What a stand-in's vehicle is really like."""

    hover_signal: float = 0.6  # of the motors, 0..1, carries the weight; thrust goes with its square
    lag_s: tuple[float, float, float] = (0.045, 0.045, 0.15)  # of body rates
    late_s: float = 0.008  # before a command has any effect
    thrust_lag_s: float = 0.025
    push_m_s2: tuple[float, float, float] = (0.4, -0.2, 0.0)  # of the wind, ENU
    natural_rad_s: float = 0.0  # of roll and pitch rates that overshoot, a second order; 0 for the lag alone
    damping: float = 0.5  # of that


@dataclass(kw_only=True)
class StandIn:
    autopilot: int
    mode: int
    hold: int
    offboard: int
    streamed: tuple[str, ...]
    params: dict[str, float]
    numbers: Numbers = field(default_factory=Numbers)
    armed: bool = False
    charge: int = 80
    silent: set[str] = field(default_factory=set)
    frozen_rate: tuple[float, float, float] | None = None
    streams: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.time_us = 0
        self.position = np.zeros(3)
        self.velocity = np.zeros(3)
        self.attitude = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))
        self.rate = np.zeros(3)
        self.turning = np.zeros(3)
        self.lift = 0.0
        self.climb_to: float | None = None
        self.setpoints: list[tuple[int, tuple[float, ...]]] = []
        self.modes: list[tuple[int, int]] = []
        self._codec, self._reads = Codec(1, 1), Codec(0, 0)
        self._inbox: list[bytes] = []
        self._outbox: list[bytes] = []
        self._due: dict[str, int] = {}

    @property
    def time_s(self) -> float:
        return self.time_us * 1e-6

    def carry(self, datagrams: list[bytes]) -> None:
        self._inbox.extend(datagrams)

    def take(self) -> list[bytes]:
        taken, self._outbox = self._outbox, []
        return taken

    def step(self) -> None:
        inbox, self._inbox = self._inbox, []
        for datagram in inbox:
            for message in self._reads.decode(datagram):
                self._receive(message)
        self._rules()
        self._move(STEP_US * 1e-6)
        self.time_us += STEP_US
        for name, interval_us in self.streams.items():
            if self.time_us >= self._due.get(name, 0):
                self._due[name] = self.time_us + interval_us
                if name not in self.silent:
                    self._send(name)

    @property
    def own_us(self) -> int:
        return self.time_us + BOOTED_US

    @property
    def airborne(self) -> bool:
        return bool(self.position[2] > 0.05)

    def choose(self, mode: int) -> None:
        self.mode = mode
        self.modes.append((self.time_us, mode))

    def _receive(self, message: Message) -> None:
        fields = message.fields
        match message.name:
            case "TIMESYNC" if fields.tc1 == 0 and "TIMESYNC" not in self.silent:
                self._outbox.append(self._codec.encode("TIMESYNC", self.own_us * 1000, fields.ts1))
            case "COMMAND_LONG":
                result = self._command(fields.command, [getattr(fields, f"param{i}") for i in range(1, 8)])
                self._outbox.append(self._codec.encode("COMMAND_ACK", fields.command, result))
            case "PARAM_REQUEST_READ":
                self._answer_parameter(fields.param_id)
            case "SET_ATTITUDE_TARGET":
                assert fields.type_mask & 128, "body rates"
                p, q, r = frd_from_flu((fields.body_roll_rate, fields.body_pitch_rate, fields.body_yaw_rate))
                self.setpoints.append((self.time_us, (p, q, r, fields.thrust)))

    def _command(self, number: int, params: list[float]) -> int:
        if number == mav.MAV_CMD_SET_MESSAGE_INTERVAL:
            name = next((n for n in self.streamed if definition_of(n).id == int(params[0])), None)
            if name is None:
                return UNSUPPORTED
            self.streams[name] = int(params[1])
            return ACCEPTED
        if number == mav.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = params[0] == 1.0
            return ACCEPTED
        if number == mav.MAV_CMD_DO_SET_MODE:
            return self._set_mode(params)
        if number == mav.MAV_CMD_NAV_TAKEOFF:
            return self._take_off(params)
        return UNSUPPORTED

    def _set_mode(self, params: list[float]) -> int:
        raise NotImplementedError

    def _take_off(self, params: list[float]) -> int:
        raise NotImplementedError

    def _answer_parameter(self, name: str) -> None:
        raise NotImplementedError

    def _rules(self) -> None:
        """Act on silence."""

    def _signal(self, thrust: float) -> float:
        raise NotImplementedError

    def _move(self, h: float) -> None:
        if not self.armed:
            return
        if self.mode != self.offboard or self.climb_to is not None or not self.setpoints:
            self._hold_still(h)
            return
        late_us = self.time_us - round(self.numbers.late_s * 1e6)
        acting = [values for at_us, values in self.setpoints[-20:] if at_us <= late_us]
        *wanted, thrust = acting[-1] if acting else (0.0, 0.0, 0.0, 0.0)
        before = self.rate
        self._follow(np.array(wanted), h)
        lift = GRAVITY * (self._signal(thrust) / self.numbers.hover_signal) ** 2
        self.lift = lift + (self.lift - lift) * exp(-h / self.numbers.thrust_lag_s)
        self._turn(0.5 * (before + self.rate), h)
        up = np.array(rotation_matrix(self.attitude))[:, 2]
        acceleration = self.lift * up - [0.0, 0.0, GRAVITY] + np.array(self.numbers.push_m_s2) - 0.1 * self.velocity
        self.position = self.position + h * (self.velocity + 0.5 * h * acceleration)
        self.velocity = self.velocity + h * acceleration

    def _follow(self, wanted: Array, h: float) -> None:
        numbers = self.numbers
        stays = np.array([exp(-h / lag_s) for lag_s in numbers.lag_s])
        lagged = wanted + (self.rate - wanted) * stays
        if numbers.natural_rad_s > 0.0:
            rate = self.rate
            for _ in range(_PARTS):
                off = numbers.natural_rad_s**2 * (wanted - rate)
                self.turning = self.turning + h / _PARTS * (
                    off - 2.0 * numbers.damping * numbers.natural_rad_s * self.turning
                )
                rate = rate + h / _PARTS * self.turning
            lagged[:2] = rate[:2]
        self.rate = lagged

    def _turn(self, rate: Array, h: float) -> None:
        w, x, y, z = self.attitude
        p, q, r = (0.5 * h * rate).tolist()
        self.attitude = normalized(
            (w - x * p - y * q - z * r, x + w * p + y * r - z * q, y + w * q + z * p - x * r, z + w * r + x * q - y * p)
        )

    def _hold_still(self, h: float) -> None:
        climb = 0.0
        if self.climb_to is not None:
            climb = min(max(1.5 * (self.climb_to - float(self.position[2])), -1.0), 1.0)
            if abs(climb) < 0.02:
                self.climb_to = None
                self._arrived()
        self.velocity += (np.array([0.0, 0.0, climb]) - self.velocity) * min(1.0, 4.0 * h)
        self.position = self.position + h * self.velocity
        self.rate, self.turning = np.zeros(3), np.zeros(3)
        w, _, _, z = self.attitude
        self.attitude = normalized((w, 0.0, 0.0, z))
        self.lift = GRAVITY

    def _arrived(self) -> None:
        """Act on the end of a take-off."""

    def _send(self, name: str) -> None:
        fields = getattr(self, f"_{name.lower()}")()
        self._outbox.append(self._codec.encode(name, *fields))

    def _heartbeat(self) -> tuple[Any, ...]:
        base = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mav.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0)
        return (mav.MAV_TYPE_QUADROTOR, self.autopilot, base, self.mode, mav.MAV_STATE_ACTIVE, 3)

    def _current_mode(self) -> tuple[Any, ...]:
        return (0, self.mode, self.mode)

    def _extended_sys_state(self) -> tuple[Any, ...]:
        return (0, mav.MAV_LANDED_STATE_IN_AIR if self.airborne else mav.MAV_LANDED_STATE_ON_GROUND)

    def _global_position_int(self) -> tuple[Any, ...]:
        height_mm = round(1e3 * float(self.position[2]))
        return (self.own_us // 1000, 0, 0, 500_000 + height_mm, height_mm, 0, 0, 0, 65535)

    def _sys_status(self) -> tuple[Any, ...]:
        parts = mav.MAV_SYS_STATUS_AHRS | mav.MAV_SYS_STATUS_PREARM_CHECK
        return (parts, parts, parts, 0, 12_000, -1, self.charge, 0, 0, 0, 0, 0, 0)

    def _estimator_status(self) -> tuple[Any, ...]:
        return (self.own_us, 0x33F, *(0.0,) * 8)

    def _local_position_ned(self) -> tuple[Any, ...]:
        place, velocity = ned_from_enu(_vector(self.position)), ned_from_enu(_vector(self.velocity))
        return (self.own_us // 1000, *place, *velocity)

    def _attitude_quaternion(self) -> tuple[Any, ...]:
        return (self.own_us // 1000, *ned_frd_from_enu_flu(self.attitude), *frd_from_flu(_vector(self.rate)))

    def _odometry(self) -> tuple[Any, ...]:
        place, velocity = ned_from_enu(_vector(self.position)), ned_from_enu(_vector(self.velocity))
        frames = (mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_LOCAL_NED)
        rate = self.frozen_rate or _vector(self.rate)
        pose = (*place, ned_frd_from_enu_flu(self.attitude), *velocity, *frd_from_flu(rate))
        return (self.own_us, *frames, *pose, _NO_COVARIANCE, _NO_COVARIANCE, 0, 8, 100)


class Px4(StandIn):
    """As PX4's interface has it.

    OFFBOARD is refused without a stream of setpoints, and left for HOLD COM_OF_LOSS_T after the last; the interval of
    HEARTBEAT cannot be changed; velocities of ODOMETRY are NED; integers of parameters travel bytewise.
    """

    def __init__(self, **more: Any) -> None:
        params = {"MPC_THR_HOVER": 0.45, "THR_MDL_FAC": 0.3, "COM_OF_LOSS_T": 0.3, "COM_RC_OVERRIDE": 1}
        modes: dict[str, Any] = {"mode": PX4_HOLD, "hold": PX4_HOLD, "offboard": PX4_OFFBOARD}
        streamed = ("ODOMETRY", "CURRENT_MODE", "ESTIMATOR_STATUS", *STREAMED)
        super().__init__(autopilot=mav.MAV_AUTOPILOT_PX4, streamed=streamed, params=params, **modes, **more)
        self.streams |= {"HEARTBEAT": 1_000_000, "ODOMETRY": 33_000}

    def _set_mode(self, params: list[float]) -> int:
        mode = int(params[1]) << 16 | int(params[2]) << 24
        fresh = [at_us for at_us, _ in self.setpoints if at_us > self.time_us - 1_000_000]
        if mode == PX4_OFFBOARD and len(fresh) < 3:
            return REJECTED
        self.choose(mode)
        return ACCEPTED

    def _take_off(self, params: list[float]) -> int:
        self.climb_to = params[6] - 500.0
        self.choose(PX4_TAKEOFF)
        return ACCEPTED

    def _arrived(self) -> None:
        self.choose(PX4_HOLD)

    def _rules(self) -> None:
        if self.mode == PX4_OFFBOARD and self.setpoints[-1][0] < self.time_us - self.params["COM_OF_LOSS_T"] * 1e6:
            self.choose(PX4_HOLD)

    def _answer_parameter(self, name: str) -> None:
        value = self.params.get(name)
        if value is None:
            return
        wire, kind = (Bits(value), ParamType.INT) if isinstance(value, int) else (value, ParamType.REAL)
        self._outbox.append(self._codec.encode("PARAM_VALUE", name, wire, kind, 1, 0))

    def _signal(self, thrust: float) -> float:
        f = self.params["THR_MDL_FAC"]
        return (-(1.0 - f) + sqrt((1.0 - f) ** 2 + 4.0 * f * thrust)) / (2.0 * f)


class ArduPilot(StandIn):
    """As ArduPilot's interface has it.

    It has neither ODOMETRY nor CURRENT_MODE; takes off in GUIDED, armed, alone; reads thrust as a climb rate unless
    GUID_OPTIONS says otherwise; its times are milliseconds; integers of parameters travel as floats.
    """

    def __init__(self, **more: Any) -> None:
        params: dict[str, float] = {
            "MOT_THST_HOVER": 0.3,
            "MOT_THST_EXPO": 0.65,
            "MOT_SPIN_MIN": 0.15,
            "MOT_SPIN_MAX": 0.95,
            "GUID_OPTIONS": 8,
            "GUID_TIMEOUT": 0.3,
            "FENCE_ENABLE": 0,
        }
        modes: dict[str, Any] = {"mode": STABILIZE, "hold": LOITER, "offboard": GUIDED}
        streamed = ("HEARTBEAT", *STREAMED)
        super().__init__(autopilot=mav.MAV_AUTOPILOT_ARDUPILOTMEGA, streamed=streamed, params=params, **modes, **more)
        self.streams |= {"HEARTBEAT": 1_000_000}

    def _set_mode(self, params: list[float]) -> int:
        self.choose(int(params[1]))
        return ACCEPTED

    def _take_off(self, params: list[float]) -> int:
        if not self.armed or self.mode != GUIDED:
            return FAILED
        self.climb_to = params[6]
        return ACCEPTED

    def _answer_parameter(self, name: str) -> None:
        value = self.params.get(name)
        if value is not None:
            kind = mav.MAV_PARAM_TYPE_INT8 if isinstance(value, int) else mav.MAV_PARAM_TYPE_REAL32
            self._outbox.append(self._codec.encode("PARAM_VALUE", name, float(value), kind, 1, 0))

    def _signal(self, thrust: float) -> float:
        e, low, high = (self.params[name] for name in ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX"))
        if not int(self.params["GUID_OPTIONS"]) & 8:
            raise AssertionError("a thrust that would be a climb rate")
        x = (-(1.0 - e) + sqrt((1.0 - e) ** 2 + 4.0 * e * thrust)) / (2.0 * e)
        return low + (high - low) * x


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)
