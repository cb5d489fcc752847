"""Services of ArduCopter: texts, version, stream rates, radio switches, simulation."""

from collections.abc import Iterable, Sequence
from math import radians

from colibri.autopilot.commander.copter_motion import AUTO
from colibri.autopilot.ground.conventions import PLACES, Served
from colibri.autopilot.guidance.mission.items import DO_AUX_FUNCTION, FENCE_SWITCH
from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.common.kernels import cos
from colibri.common.types import Vector
from colibri.mavlink.hil.faults import GPS, MOTOR, OFF, OK, WRONG, Fault
from colibri.mavlink.hil.world_changes import PaceChange, WindChange, WorldChange
from colibri.mavlink.mission.items import MISSION, MissionItem
from colibri.mavlink.node.service import Peer, Send, Service, to
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.statustext import CRITICAL, INFO, WARNING
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import Message, mav

_KNOWN_BY = frozenset({"HEARTBEAT", "REQUEST_DATA_STREAM", "PARAM_REQUEST_LIST", "COMMAND_LONG"})
_USING_GPS = ("AHRS: EKF3 active", "EKF3 IMU0 origin set", "EKF3 IMU0 is using GPS")
_PREARM_EVERY_US = 30_000_000
_SWITCHES_US = (1230, 1360, 1490, 1620, 1749)  # upper ends of the first five positions of the mode switch
_LOW_US, _HIGH_US, _CHANNEL_US = 1200, 1800, (800, 2200)
_RAISED_US = 1600
_THROTTLE, _YAW, _DOWN_US, _RIGHT_US, _LEFT_US, _HELD_US = 2, 3, 1050, 1900, 1100, 2_000_000
_ARMS, _DISARMS = 1, 2
_MODE_OPTIONS = {4: 6, 16: 3, 18: 9, 33: 17, 52: 1, 55: 4, 56: 5, 57: 23, 68: 0, 69: 16, 70: 2, 72: 7}
"""Mode number by RCn_OPTION."""
_ARM_OPTIONS = (41, 153)
_SAVES_WAYPOINT, _RESETS_MISSION, _CLEARS_MISSION = 7, 24, 58
_WHILE_ARMED = 3  # FENCE_AUTOENABLE
_LOW, _MIDDLE, _HIGH = _LEVELS = (0, 1, 2)
_M_PER_DEG = 111_319.5
_STREAMS = {
    "RAW_SENS": mav.MAV_DATA_STREAM_RAW_SENSORS,
    "EXT_STAT": mav.MAV_DATA_STREAM_EXTENDED_STATUS,
    "RC_CHAN": mav.MAV_DATA_STREAM_RC_CHANNELS,
    "POSITION": mav.MAV_DATA_STREAM_POSITION,
    "EXTRA1": mav.MAV_DATA_STREAM_EXTRA1,
    "EXTRA2": mav.MAV_DATA_STREAM_EXTRA2,
    "EXTRA3": mav.MAV_DATA_STREAM_EXTRA3,
}
"""MAV_DATA_STREAM by the end of SR0_*."""


class Polled:
    """A service that receives no messages."""

    handles = frozenset[str]()

    def __init__(self, served: Served) -> None:
        self._served = served

    def receive(self, _message: Message, _peer: Peer, _now_us: int) -> Iterable[Send]:
        return ()


class Meeting(Polled):
    """A service that knows of new channels."""

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._new: list[int] = []

    def opened(self, channel: int, _now_us: int) -> None:
        self._new.append(channel)

    def closed(self, channel: int) -> None: ...


class Greeter(Meeting):
    """Sends new clients the texts that tools wait for."""

    handles = _KNOWN_BY

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._met: set[Peer] = set()

    def closed(self, channel: int) -> None:
        self._met = {peer for peer in self._met if peer.channel != channel}

    def receive(self, message: Message, peer: Peer, _now_us: int) -> Iterable[Send]:
        texts = self._served.banner if message.name == "PARAM_REQUEST_LIST" else ()
        if peer not in self._met:
            self._met.add(peer)
            self._new.append(peer.channel)
        return [_text(text, peer.channel) for text in texts]

    def poll(self, _now_us: int) -> Iterable[Send]:
        snapshot = self._served.snapshot
        if not self._new or snapshot is None or not snapshot.gps_ok:
            return ()
        channels, self._new = dict.fromkeys(self._new), []
        return [_text(text, channel) for channel in channels for text in _USING_GPS]


def _text(text: str, channel: int) -> Send:
    return Send("STATUSTEXT", (INFO, text.encode(), 0, 0), channel)


class Places(Polled):
    """Reports home and origin at arming, and when they change."""

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._shown = self._place()

    def _place(self) -> tuple[Vector, Geodetic, int]:
        pilot = self._served.pilot
        return (pilot.home.position_enu_m, pilot.home.origin, pilot.ground.times.flights)

    def poll(self, _now_us: int) -> Iterable[Send]:
        place = self._place()
        if place == self._shown:
            return ()
        self._shown = place
        return [Send(name, fields) for name in PLACES for fields in self._served.streams.encode(name)]


class Requests:
    """Answers a request of the version, and of terrain: it is not known anywhere."""

    handles = frozenset({"AUTOPILOT_VERSION_REQUEST", "TERRAIN_CHECK"})

    def __init__(self, served: Served) -> None:
        self._version = served.system.version

    def receive(self, message: Message, peer: Peer, _now_us: int) -> Iterable[Send]:
        if message.name == "TERRAIN_CHECK":
            return [to(peer, "TERRAIN_REPORT", message.fields.lat, message.fields.lon, 0, 0.0, 0.0, 0, 0)]
        return [to(peer, "AUTOPILOT_VERSION", *self._version)]


class StreamRates(Meeting):
    """Keeps requested rates in SR0_*, and streams by them on every channel."""

    handles = frozenset({"REQUEST_DATA_STREAM"})

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._revision, self._rates = -1, dict.fromkeys(_STREAMS, 0)

    def receive(self, message: Message, _peer: Peer, _now_us: int) -> Iterable[Send]:
        fields = message.fields
        rate = min(fields.req_message_rate, 50) if fields.start_stop else 0
        for name, number in _STREAMS.items():
            if fields.req_stream_id in (number, mav.MAV_DATA_STREAM_ALL):
                self._rates[name] = rate
                self._served.parameters.set(f"SR0_{name}", rate)  # silently, as ArduPilot
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        served, new = self._served, self._new
        if served.parameters.revision == self._revision and not new:
            return ()
        self._revision, self._new = served.parameters.revision, []
        for name, number in _STREAMS.items():
            rate, before = int(served.parameters[f"SR0_{name}"]), self._rates[name]
            self._rates[name] = rate
            for channel in served.streams.channels if rate != before else new if rate else ():
                served.streams.set_group(channel, number, rate, now_us)
        return ()


class PreArm(Polled):
    """Says twice a minute why the vehicle cannot arm."""

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._due_us = _PREARM_EVERY_US

    def poll(self, now_us: int) -> Iterable[Send]:
        snapshot = self._served.snapshot
        if snapshot is not None and now_us >= self._due_us:
            self._due_us = now_us + _PREARM_EVERY_US
            if not snapshot.armed:
                for reason in self._served.pilot.readiness.refusals():
                    self._served.say(CRITICAL, f"PreArm: {reason}")
        return ()


class Switches(Polled):
    """Carries out the functions of switches, of commands and mission items instead of them, and of the yaw stick."""

    handles = frozenset({"COMMAND_LONG", "COMMAND_INT"})

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._channels: tuple[int, ...] = ()
        self._position: int | None = None
        self._seen: TelemetrySnapshot | None = None
        self._fenced = False
        self._levels: dict[int, int] = {}
        self._stick, self._since_us = 0, 0

    def receive(self, message: Message, _peer: Peer, _now_us: int) -> Iterable[Send]:
        fields = message.fields
        if fields.command == DO_AUX_FUNCTION and fields.param2 in _LEVELS:
            self._act(int(fields.param1), int(fields.param2))
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        snapshot, functions = self._served.snapshot, self._served.missions.functions
        while functions:
            self._act(*functions.pop(0))
        if snapshot is None or snapshot is self._seen:
            return ()
        self._seen, channels = snapshot, snapshot.channels
        self._enable_fence(int(self._served.parameters["FENCE_AUTOENABLE"]), snapshot)
        if not channels:
            return ()
        if channels != self._channels:
            self._channels = channels
            self._switch(channels, armed=snapshot.armed)
            for number in range(6, len(channels) + 1):
                self._function(number, channels[number - 1])
        height_m = 0.01 * self._served.parameters["PILOT_TKOFF_ALT"]
        if height_m > 0.0 and snapshot.armed and channels[_THROTTLE] > _RAISED_US:
            self._served.takeoff_by_stick(height_m)
        self._rudder(channels, now_us, armed=snapshot.armed, manual=snapshot.custom_mode == 0)
        return ()

    def _enable_fence(self, when: int, snapshot: TelemetrySnapshot) -> None:
        """Enable the fence in flight, or while armed (3)."""
        flies = snapshot.landed_state == mav.MAV_LANDED_STATE_IN_AIR
        wanted = snapshot.armed and when > 0 and (flies or when == _WHILE_ARMED or self._fenced)
        if wanted is not self._fenced:
            self._fenced = wanted
            self._served.parameters.propose("FENCE_ENABLE", int(wanted))

    def _switch(self, channels: tuple[int, ...], *, armed: bool) -> None:
        number = int(self._served.parameters["FLTMODE_CH"])
        low, high = _CHANNEL_US
        if not 0 < number <= len(channels) or not low < channels[number - 1] < high:
            return
        position = sum(channels[number - 1] > end for end in _SWITCHES_US)
        before, self._position = self._position, position
        if before != position and not (before is None and armed):
            self._select(int(self._served.parameters[f"FLTMODE{position + 1}"]))

    def _select(self, number: int) -> None:
        refusal = self._served.modes.select(number)
        if refusal is not None:
            self._served.say(WARNING, refusal.reason)

    def _function(self, number: int, value: int) -> None:
        low, high = _CHANNEL_US
        if not low < value < high:
            return
        level = _HIGH if value > _HIGH_US else _LOW if value < _LOW_US else _MIDDLE
        before, self._levels[number] = self._levels.get(number), level
        option = int(self._served.parameters[f"RC{number}_OPTION"]) if number <= 16 else 0
        begins_high = before is None and level == _HIGH and option not in _ARM_OPTIONS
        if option and (begins_high or before not in (None, level)):
            self._act(option, level)

    def _act(self, option: int, level: int) -> None:
        """Carry out a function: RC_Channel.cpp."""
        served, high, mode = self._served, level == _HIGH, _MODE_OPTIONS.get(option)
        if mode is not None and level != _MIDDLE:
            position = self._position or 0
            self._select(mode if high else int(served.parameters[f"FLTMODE{position + 1}"]))
        elif option == FENCE_SWITCH:
            served.parameters.propose("FENCE_ENABLE", int(high))
        elif option in _ARM_OPTIONS and level != _MIDDLE:
            self._arm(high)
        elif option == _CLEARS_MISSION and high:
            served.plans.load(MISSION, ())
        elif option == _RESETS_MISSION and high:
            served.plans.choose(0)
        elif option == _SAVES_WAYPOINT and high:
            self._save_waypoint()

    def _save_waypoint(self) -> None:
        """Append the place to the mission: a take-off first, and a landing without throttle."""
        served, snapshot = self._served, self._served.snapshot
        throttle = self._channels[_THROTTLE] > _DOWN_US if self._channels else False
        items = served.plans.plans[MISSION].items
        if snapshot is None or not snapshot.armed or snapshot.custom_mode == AUTO or not (items or throttle):
            return
        place = geodetic_of(snapshot.position_enu_m, snapshot.origin)
        height_m = snapshot.position_enu_m[2] - served.pilot.home.position_enu_m[2]
        x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
        command = mav.MAV_CMD_NAV_WAYPOINT if throttle else mav.MAV_CMD_NAV_LAND
        up = _item(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, max(height_m, 1.0))
        served.plans.load(MISSION, [*(items or (up,)), _item(command, x, y, height_m)])
        served.say(INFO, "Saved waypoint")

    def _arm(self, arms: bool) -> None:
        refusal = self._served.modes.arm(force=False) if arms else self._served.pilot.disarm()
        if refusal is not None:
            self._served.say(CRITICAL, refusal.reason)

    def _rudder(self, channels: tuple[int, ...], now_us: int, *, armed: bool, manual: bool) -> None:
        """Arm after two seconds of full right yaw without throttle, disarm after left."""
        down, yaw = channels[_THROTTLE] <= _DOWN_US, channels[_YAW]
        stick = 0 if not down else 1 if yaw >= _RIGHT_US else -1 if yaw <= _LEFT_US else 0
        if stick != self._stick:
            self._stick, self._since_us = stick, now_us
        elif stick and now_us - self._since_us >= _HELD_US:
            self._since_us = now_us
            allowed = int(self._served.parameters["ARMING_RUDDER"])
            if stick > 0 and not armed and allowed >= _ARMS:
                self._arm(True)
            elif stick < 0 and armed and allowed >= _DISARMS:
                self._served.pilot.disarm(force=manual)


def _item(command: int, x: int, y: int, height_m: float) -> MissionItem:
    return MissionItem(mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, command, 1, 0.0, 0.0, 0.0, 0.0, x, y, height_m)


class SimulatedWorld(Polled):
    """Changes of the simulated world by SIM_*."""

    def __init__(self, served: Served) -> None:
        super().__init__(served)
        self._revision = served.parameters.revision
        self._flown = dict(_WORLD_AT_REST)

    def poll(self, _now_us: int) -> Iterable[Send]:
        served = self._served
        if served.parameters.revision == self._revision or served.snapshot is None:
            return ()
        self._revision = served.parameters.revision
        wanted = _world(served.parameters, served.snapshot.origin.latitude_deg)
        for part, change in wanted.items():
            if self._flown.get(part) != change:
                refusal = served.failures.request(change)
                if refusal is not None and not self._flown.get(part):
                    served.say(WARNING, f"SIM_{part}: {refusal.reason}")
        self._flown = wanted
        return ()


def _world(values: Parameters, latitude_deg: float) -> dict[str, Fault | WorldChange]:
    """Return the wanted change of each part of the world."""
    jump = (
        values["SIM_GPS1_GLTCH_Y"] * _M_PER_DEG * cos(radians(latitude_deg)),
        values["SIM_GPS1_GLTCH_X"] * _M_PER_DEG,
        values["SIM_GPS1_GLTCH_Z"],
        0.0,
    )
    gps = Fault(GPS, WRONG, values=jump) if any(jump) else Fault(GPS, OK)
    found: dict[str, Fault | WorldChange] = {
        "SPEEDUP": PaceChange(values["SIM_SPEEDUP"]),
        "WIND": WindChange(values["SIM_WIND_SPD"], values["SIM_WIND_DIR"]),
        "GPS1": gps if values["SIM_GPS1_ENABLE"] else Fault(GPS, OFF),
    }
    failed, share = int(values["SIM_ENGINE_FAIL"]), values["SIM_ENGINE_MUL"]
    for motor in range(_MOTORS):
        weak = failed >> motor & 1 and share < 1.0
        kind = OK if not weak else WRONG if share > 0.0 else OFF
        numbers = (share, 0.0, 0.0, 0.0) if kind == WRONG else (0.0, 0.0, 0.0, 0.0)
        found[f"ENGINE_{motor + 1}"] = Fault(MOTOR, kind, motor + 1, numbers)
    return found


_MOTORS = 8
_WORLD_AT_REST: dict[str, Fault | WorldChange] = {
    "SPEEDUP": PaceChange(1.0),
    "WIND": WindChange(0.0, 180.0),
    "GPS1": Fault(GPS, OK),
    **{f"ENGINE_{motor + 1}": Fault(MOTOR, OK, motor + 1) for motor in range(_MOTORS)},
}


def copter_services(served: Served) -> Sequence[Service]:
    kinds = (Greeter, Places, Requests, StreamRates, PreArm, Switches, SimulatedWorld)
    return [kind(served) for kind in kinds]
