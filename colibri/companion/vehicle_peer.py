"""The vehicle at the other end of a link: bytes and time in, bytes and timed states out."""

from collections import deque
from math import hypot
from typing import NamedTuple

from colibri.common.earth.geodesy import Geodetic, enu_of
from colibri.companion.stack import Stack, recognised
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.clock import VehicleClock
from colibri.mavlink.client.commands import Command, set_message_interval
from colibri.mavlink.client.conversation import Repeat
from colibri.mavlink.client.parameters import ReadParameter
from colibri.mavlink.client.report import VehicleReport
from colibri.mavlink.client.states import HANDLES, StateAssembler
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Message, mav

OWN_SYSTEM, OWN_COMPONENT = 1, mav.MAV_COMP_ID_ONBOARD_COMPUTER
_HEARTBEAT_EVERY_US = 500_000
_RENEW_EVERY_US = 3_000_000
_ENOUGH_OF_A_STREAM = 0.5
_SECOND_US = 1_000_000
_VERSION_TRIES = 4
_VERSION_EVERY_US = 400_000
_HOME_EVERY_US = 500_000
_REMEMBERED_DELAYS = 50
_COMMANDS = Repeat(every_us=300_000, tries=5)
_PARAMETERS = Repeat(every_us=500_000, tries=4)


class ReceivedState(NamedTuple):
    """A state and its time on the companion's clock."""

    at_us: int
    state: StateFrame


class LocalOrigin(NamedTuple):
    """Origin of the local frame, and height of home in it."""

    origin: Geodetic
    up_m: float


def local_origin(report: VehicleReport) -> LocalOrigin | None:
    home, origin = report.home, report.origin
    if home is None or origin is None:
        return None
    return LocalOrigin(origin, home.altitude_m - origin.altitude_m)


class VehiclePeer:
    """One vehicle; `system` is 0 and `stack` `None` until known."""

    def __init__(self, stack: Stack | None = None, system: int = 0) -> None:
        own = mav.MAV_TYPE_ONBOARD_CONTROLLER
        beats_us = _HEARTBEAT_EVERY_US
        self.client = Client(OWN_SYSTEM, OWN_COMPONENT, kind=own, heartbeat_every_us=beats_us, only=system)
        self.report = VehicleReport()
        self.clock = VehicleClock()
        self.stack = stack
        self.system = 0
        self.reports_are_old = False  # as judged by the owner
        self._orders: dict[str, Command] = {}
        self._streams: list[Command] = []
        self._parameters: list[ReadParameter] | None = None
        self._states = StateAssembler()
        self._renew_at_us = self._version_at_us = self._version_tries = self._home_at_us = 0
        self._arrivals_us: deque[int] = deque()
        self._delays_us: deque[int] = deque(maxlen=_REMEMBERED_DELAYS)

    @property
    def connected(self) -> bool:
        return self.system != 0 and self.stack is not None

    @property
    def parameter_values(self) -> dict[str, float] | None:
        if self._parameters is None or any(reading.result is None for reading in self._parameters):
            return None
        return {reading.name: float(reading.held.value) for reading in self._parameters if reading.held is not None}

    # Commands, by name.

    @property
    def results(self) -> dict[str, int]:
        return {name: order.result for name, order in self._orders.items() if order.result is not None}

    def ask(self, name: str, number: int, *params: float) -> None:
        """Send a command until it is acknowledged, unless it is pending."""
        under_way = self._orders.get(name)
        if under_way is None or under_way.result is not None:
            self._orders[name] = self.client.begin(Command(self.target, number, *params, repeat=_COMMANDS))

    def forget(self, name: str) -> None:
        self._orders.pop(name, None)

    def clear(self) -> None:
        for name in [name for name, order in self._orders.items() if order.result is None]:
            self.client.cancel(self._orders.pop(name))

    def state_rate_hz(self, now_us: int) -> float:
        return float(sum(1 for at_us in self._arrivals_us if now_us - at_us <= _SECOND_US))

    @property
    def state_delay_s(self) -> float:
        delays = sorted(self._delays_us)
        return 1e-6 * delays[len(delays) // 2] if delays else 0.0

    def receive(self, datagram: bytes, now_us: int) -> list[ReceivedState]:
        received = []
        for message in self.client.receive(datagram, now_us):
            vehicle = self.client.vehicle
            self.system = 0 if vehicle is None else vehicle.system
            if self.system == message.source[0]:
                state = self._take(message, now_us)
                if state is not None:
                    received.append(state)
        return received

    def poll(self, now_us: int) -> list[bytes]:
        if self.system == 0:
            return self.client.poll(now_us)
        self._recognise(now_us)
        self._renew_streams(now_us)
        frames = self.client.poll(now_us)
        asked = self.clock.request(now_us)
        if asked is not None:
            frames.append(self.client.encode("TIMESYNC", *asked))
        return frames

    @property
    def target(self) -> tuple[int, int]:
        return (self.system, AUTOPILOT_COMPONENT)

    def _take(self, message: Message, now_us: int) -> ReceivedState | None:
        self.report.receive(message, now_us)
        fields = message.fields
        match message.name:
            case "TIMESYNC":
                self.clock.receive(fields.tc1, fields.ts1, now_us)
            case "AUTOPILOT_VERSION" if self.stack is None:
                self._meet(recognised(self.report.autopilot, bytes(fields.uid2)))
            case name if name in HANDLES:
                return self._timed(message, now_us)
        return None

    def _timed(self, message: Message, now_us: int) -> ReceivedState | None:
        state = self._states.receive(message, now_us)
        if state is None:
            return None
        self._arrivals_us.append(now_us)
        while self._arrivals_us[0] < now_us - _SECOND_US:
            self._arrivals_us.popleft()
        if not self.clock.known:
            return None
        at_us = min(self.clock.own_us(state.time_us), now_us)
        self._delays_us.append(now_us - at_us)
        return ReceivedState(at_us, state)

    def _recognise(self, now_us: int) -> None:
        if self.stack is not None:
            if self._parameters is None:
                self._meet(self.stack)
            return
        if now_us < self._version_at_us:
            return
        self._version_at_us = now_us + _VERSION_EVERY_US
        self._version_tries += 1
        if self._version_tries > _VERSION_TRIES:
            self._meet(recognised(self.report.autopilot, b""))
        else:
            self._request("AUTOPILOT_VERSION")

    def seek_home(self, now_us: int) -> LocalOrigin | None:
        """Return home; until it is known, request HOME_POSITION and GPS_GLOBAL_ORIGIN."""
        home = local_origin(self.report)
        if home is None and self.system and now_us >= self._home_at_us:
            self._home_at_us = now_us + _HOME_EVERY_US
            self._request("HOME_POSITION")
            self._request("GPS_GLOBAL_ORIGIN")
        return home

    def _request(self, name: str) -> None:
        self.ask(name, mav.MAV_CMD_REQUEST_MESSAGE, float(getattr(mav, f"MAVLINK_MSG_ID_{name}")))

    def _meet(self, stack: Stack | None) -> None:
        if stack is None:
            return
        self.stack = stack
        by_bits = stack.integers_by_bits
        self._parameters = [
            self.client.begin(ReadParameter(self.target, name, by_bits=by_bits, repeat=_PARAMETERS))
            for name in stack.parameters
        ]

    def _renew_streams(self, now_us: int) -> None:
        under_way = any(stream.result is None for stream in self._streams)
        if self.stack is None or now_us < self._renew_at_us or under_way:
            return
        self._renew_at_us = now_us + _RENEW_EVERY_US
        streams = self.stack.streams
        wanted_hz = max(streams[name] for name in HANDLES & streams.keys())
        if self.reports_are_old or self.state_rate_hz(now_us) < _ENOUGH_OF_A_STREAM * wanted_hz:
            self._streams = [
                self.client.begin(set_message_interval(self.target, name, 1e6 / rate_hz, repeat=_COMMANDS))
                for name, rate_hz in streams.items()
            ]


def moved_m(planned: LocalOrigin | None, report: VehicleReport) -> float:
    """Return by how much home or the local frame has moved, m."""
    now = local_origin(report)
    if planned is None or now is None:
        return 0.0
    return max(abs(now.up_m - planned.up_m), hypot(*enu_of(now.origin, planned.origin)))
