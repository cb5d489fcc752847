"""A ground station that asks for a lot and keeps account of what it is told; it drives nothing by the wall clock."""

import socket
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain, cycle, pairwise
from select import select
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any, NamedTuple, Self

from mavlink.dialect import AUTOPILOT_COMPONENT, Codec, Message, mav

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
LONG = "COMMAND_LONG"

_LOOK_EVERY_S = 0.02
_ALIVE_EVERY_S = 0.5
_BUFFER_BYTES = 4_000_000
_ASKED = ("AUTOPILOT_VERSION", "HOME_POSITION", "ODOMETRY", "ESTIMATOR_STATUS", "AVAILABLE_MODES", "GPS_GLOBAL_ORIGIN")
_STREAMED_US = {"ATTITUDE_QUATERNION": 4_000, "LOCAL_POSITION_NED": 8_000, "HIGHRES_IMU": 8_000, "ATTITUDE": 20_000}


class Ack(NamedTuple):
    """An acknowledgement.

    Attributes:
        command: MAV_CMD.
        result: MAV_RESULT.
        target: System and component that it is for.
    """

    command: int
    result: int
    target: tuple[int, int]


class Station:
    """A ground station on a port of this computer, in a thread.

    Attributes:
        url: The link that the vehicle is to serve.
        identity: System and component that it speaks as.
        sent: Commands that were sent, by MAV_CMD.
    """

    def __init__(
        self,
        system_id: int,
        component_id: int = mav.MAV_COMP_ID_MISSIONPLANNER,
        *,
        every: int = 25,
        orders: Sequence[tuple[float, ...]] = (),
    ) -> None:
        """Ask for something with every `every` datagrams that come: first `orders`, a MAV_CMD and its parameters each.

        After them it asks for all that a ground station may ask for, over and over.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        self._socket.bind(("127.0.0.1", 0))
        self.url = f"udpout:127.0.0.1:{self._socket.getsockname()[1]}"
        self.identity = (system_id, component_id)
        self.sent: Counter[int] = Counter()
        self._every = every
        self._codec = Codec(*self.identity)
        self._vehicle: tuple[str, int] | None = None
        self._wishes = chain(self._orders(orders), cycle(self._wish()))
        self._datagrams = 0
        self._alive_s = 0.0
        self._counts: Counter[str] = Counter()
        self._acks: list[Ack] = []
        self._heartbeats_s: list[float] = []
        self._lock = Lock()
        self._ended = Event()
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        """Begin."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End."""
        self._ended.set()
        self._thread.join()
        self._socket.close()

    @property
    def counts(self) -> Counter[str]:
        """How many messages of each name came from the vehicle."""
        with self._lock:
            return self._counts.copy()

    @property
    def acks(self) -> list[Ack]:
        """What was acknowledged, to whomever."""
        with self._lock:
            return list(self._acks)

    @property
    def longest_gap_s(self) -> float:
        """The longest wall-clock time between two heartbeats of the vehicle."""
        with self._lock:
            times = self._heartbeats_s
            return max((after - before for before, after in pairwise(times)), default=0.0)

    def _run(self) -> None:
        while not self._ended.is_set():
            if select([self._socket], [], [], _LOOK_EVERY_S)[0]:
                datagram, self._vehicle = self._socket.recvfrom(4096)
                with self._lock:
                    for message in self._codec.decode(datagram):
                        self._take(message)
                self._datagrams += 1
                if self._datagrams % self._every == 0:
                    next(self._wishes)()
            if self._vehicle and monotonic() >= self._alive_s + _ALIVE_EVERY_S:
                self._alive_s = monotonic()
                self._send("HEARTBEAT", mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3)

    def _take(self, message: Message) -> None:
        if message.source[1] != AUTOPILOT_COMPONENT:
            return
        self._counts[message.name] += 1
        if message.name == "HEARTBEAT":
            self._heartbeats_s.append(monotonic())
        elif message.name == "COMMAND_ACK":
            fields = message.fields
            target = (fields.target_system, fields.target_component)
            self._acks.append(Ack(fields.command, fields.result, target))

    def _orders(self, orders: Sequence[tuple[float, ...]]) -> Iterator[Callable[[], None]]:
        for command, *parameters in orders:
            yield partial(self._command, int(command), *parameters)

    def _wish(self) -> Iterator[Callable[[], None]]:
        """Yield what a ground station asks for, of every kind."""
        for name, interval_us in _STREAMED_US.items():
            yield partial(self._command, mav.MAV_CMD_SET_MESSAGE_INTERVAL, _number(name), interval_us)
        for name in _ASKED:
            yield partial(self._command, mav.MAV_CMD_REQUEST_MESSAGE, _number(name))
        yield partial(self._to_vehicle, "PARAM_REQUEST_LIST")
        yield partial(self._to_vehicle, "PARAM_REQUEST_READ", "TRACK", -1)
        yield partial(self._to_vehicle, "MISSION_REQUEST_LIST", mav.MAV_MISSION_TYPE_MISSION)
        yield partial(self._send, "PING", 0, 7, 0, 0)
        yield partial(self._send, "TIMESYNC", 0, 7)

    def _command(self, command: int, *parameters: float) -> None:
        self.sent[command] += 1
        self._to_vehicle(LONG, command, 0, *parameters, *[0.0] * (7 - len(parameters)))

    def _to_vehicle(self, name: str, *fields: Any) -> None:
        self._send(name, 1, AUTOPILOT_COMPONENT, *fields)

    def _send(self, name: str, *fields: Any) -> None:
        assert self._vehicle is not None, "it is heard before it is spoken to"
        self._socket.sendto(self._codec.encode(name, *fields), self._vehicle)


def _number(name: str) -> int:
    number: int = getattr(mav, f"MAVLINK_MSG_ID_{name}")
    return number
