"""Observes a vehicle on a separate link."""

from collections.abc import Callable
from threading import Condition
from time import monotonic
from typing import Any, NamedTuple

from colibri.autopilot.commander.rules.modes import Mode, mode_of_custom
from colibri.common.rotations import euler_from_quaternion
from colibri.common.types import Vector
from colibri.mavlink.client.client import Client, Talk, VehicleFound
from colibri.mavlink.client.commands import Command, set_message_interval
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.client.parameters import ReadParameter, SetParameter
from colibri.mavlink.client.plans import Download
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, MODE_ARMED, Message, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu
from tools.harness.ports import OnPort

ON_GROUND: int = mav.MAV_LANDED_STATE_ON_GROUND
GIVE_UP_AFTER_S = 60.0

_SYSTEM_ID = 240
_INTERVALS_US = {"LOCAL_POSITION_NED": 50_000, "ATTITUDE_QUATERNION": 50_000, "EXTENDED_SYS_STATE": 100_000}
_NEEDED = {"HEARTBEAT", "ATTITUDE_QUATERNION", "EXTENDED_SYS_STATE"}


class Sight(NamedTuple):
    time_s: float
    position_enu_m: Vector
    velocity_enu_m_s: Vector
    euler_rad: Vector
    rate_flu_rad_s: Vector
    mode: Mode | None
    armed: bool
    landed: int

    @property
    def height_m(self) -> float:
        return self.position_enu_m[2]

    @property
    def flying(self) -> bool:
        return self.landed not in (ON_GROUND, mav.MAV_LANDED_STATE_UNDEFINED)


class Observer(OnPort, Inbox):
    """Records the messages of a vehicle."""

    def __init__(self) -> None:
        OnPort.__init__(self, self)
        Inbox.__init__(self)
        own = mav.MAV_COMP_ID_MISSIONPLANNER
        self._client = Client(_SYSTEM_ID, own, heartbeat_every_us=None, all_components=True)
        self.sights: list[Sight] = []
        self._latest: dict[str, Any] = {}
        self._modes: list[Mode] = []
        self._news = Condition()

    @property
    def now(self) -> Sight:
        return self.sights[-1]

    @property
    def fix(self) -> int:
        return int(self._latest["GPS_RAW_INT"].fix_type)

    def modes(self) -> list[Mode]:
        """Return the modes of armed heartbeats, without repetition."""
        return list(self._modes)

    def in_mode(self, mode: Mode) -> list[Sight]:
        return [sight for sight in self.sights if sight.mode is mode and sight.armed and sight.flying]

    def wait(self, condition: Callable[[Sight], bool], what: str, within_s: float = GIVE_UP_AFTER_S) -> Sight:
        """Return the first sight from now on that meets a condition; `within_s` only bounds hangs."""
        with self._news:
            seen = len(self.sights) - 1
            give_up_s = monotonic() + within_s
            while True:
                for sight in self.sights[max(seen, 0) :]:
                    if condition(sight):
                        return sight
                seen = len(self.sights)
                left_s = give_up_s - monotonic()
                last = self.sights[-1] if self.sights else None
                assert left_s > 0.0, f"waited in vain for {what}; {last}; {self.texts}"
                self._news.wait(left_s)

    def wait_until_disarmed(self) -> Sight:
        """Return the first sight after a flight."""
        return self.wait(lambda sight: not sight.armed and any(it.armed for it in self.sights), "the end of the flight")

    @property
    def _vehicle(self) -> tuple[int, int]:
        assert self._client.vehicle is not None, "it was found"
        return self._client.vehicle.target

    def request(self, answer: str, name: str, *fields: Any, within_s: float = 5.0) -> Any:
        """Return the `answer` to a message with target ids."""
        with self._news:
            before = self.counts[answer]
            self.send(self._client.encode(name, *self._vehicle, *fields))
            assert self._news.wait_for(lambda: self.counts[answer] > before, within_s), f"no {answer}"
            return self._latest[answer]

    def command(self, number: int, *params: float) -> int | None:
        return self._talk(Command(self._vehicle, number, *params)).result

    def plan_length(self, mission_type: int = mav.MAV_MISSION_TYPE_MISSION) -> int:
        download = self._talk(Download(self._vehicle, mission_type))
        assert download.accepted
        return len(download.items)

    def parameter(self, name: str) -> float:
        held = self._talk(ReadParameter(self._vehicle, name)).held
        assert held is not None, f"no {name}"
        return held.value

    def set_parameter(self, name: str, value: float) -> None:
        assert self._talk(SetParameter(self._vehicle, name, value)).accepted

    def _talk(self, conversation: Talk) -> Talk:
        with self._news:
            self._client.begin(conversation)
            assert self._news.wait_for(lambda: conversation.result is not None, GIVE_UP_AFTER_S)
        return conversation

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        now_us = round(now_s * 1e6)
        with self._news:
            for message in self._client.receive(datagram, now_us):
                self._take(message)
            for event in self._client.take_events():
                if isinstance(event, VehicleFound):
                    for name, interval_us in _INTERVALS_US.items():
                        self._client.begin(set_message_interval(event.vehicle.target, name, interval_us))
            self._news.notify_all()
            return self._client.poll(now_us)

    def _take(self, message: Message) -> None:
        self.add(message)
        name, fields = message.name, message.fields
        if message.source[1] != AUTOPILOT_COMPONENT:
            return
        self._latest[name] = fields
        if name == "HEARTBEAT":
            self._note_mode(fields)
        elif name == "LOCAL_POSITION_NED" and self._latest.keys() >= _NEEDED:
            self.sights.append(self._sight())

    def _note_mode(self, heartbeat: Any) -> None:
        mode = mode_of_custom(heartbeat.custom_mode)
        if heartbeat.base_mode & MODE_ARMED and mode and self._modes[-1:] != [mode]:
            self._modes.append(mode)

    def _sight(self) -> Sight:
        where, heartbeat = self._latest["LOCAL_POSITION_NED"], self._latest["HEARTBEAT"]
        attitude = self._latest["ATTITUDE_QUATERNION"]
        return Sight(
            where.time_boot_ms * 1e-3,
            ned_from_enu((where.x, where.y, where.z)),
            ned_from_enu((where.vx, where.vy, where.vz)),
            euler_from_quaternion(ned_frd_from_enu_flu((attitude.q1, attitude.q2, attitude.q3, attitude.q4))),
            frd_from_flu((attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)),
            mode_of_custom(heartbeat.custom_mode),
            bool(heartbeat.base_mode & MODE_ARMED),
            self._latest["EXTENDED_SYS_STATE"].landed_state,
        )
