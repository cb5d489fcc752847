"""Services of ArduCopter beside the common ones: greeting, version, pre-arm texts, mode switch."""

from collections.abc import Iterable, Sequence

from colibri.autopilot.ground.conventions import Served
from colibri.mavlink.node.service import Peer, Send, Service, to
from colibri.mavlink.services.statustext import CRITICAL, INFO
from colibri.mavlink.wire.dialect import Message

_KNOWN_BY = frozenset({"HEARTBEAT", "REQUEST_DATA_STREAM", "PARAM_REQUEST_LIST", "COMMAND_LONG"})
_USING_GPS = ("EKF3 IMU0 origin set", "EKF3 IMU0 is using GPS")
_PREARM_EVERY_US = 30_000_000
_SWITCHES_US = (1230, 1360, 1490, 1620, 1749)
"""Upper ends of the first five positions of the mode switch."""
_CHANNEL_US = (800, 2200)


class Greeter:
    """Sends every new client the texts of the start that tools wait for."""

    handles = _KNOWN_BY

    def __init__(self, served: Served) -> None:
        self._served = served
        self._met: set[Peer] = set()
        self._new: list[int] = []

    def opened(self, channel: int, now_us: int) -> None:
        del now_us
        self._new.append(channel)

    def closed(self, channel: int) -> None:
        self._met = {peer for peer in self._met if peer.channel != channel}

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        del message, now_us
        if peer not in self._met:
            self._met.add(peer)
            self._new.append(peer.channel)
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        del now_us
        snapshot = self._served.snapshot
        if not self._new or snapshot is None or not snapshot.gps_ok:
            return ()
        channels, self._new = dict.fromkeys(self._new), []
        return [Send("STATUSTEXT", (INFO, text.encode(), 0, 0), channel) for channel in channels for text in _USING_GPS]


class VersionRequests:
    """Answers AUTOPILOT_VERSION_REQUEST."""

    handles = frozenset({"AUTOPILOT_VERSION_REQUEST"})

    def __init__(self, served: Served) -> None:
        self._version = served.system.version

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        del message, now_us
        return [to(peer, "AUTOPILOT_VERSION", *self._version)]


class Watch:
    """Says why the vehicle cannot arm, and selects the mode of the mode switch when it moves."""

    handles = frozenset[str]()

    def __init__(self, served: Served) -> None:
        self._served = served
        self._prearm_us = _PREARM_EVERY_US
        self._position: int | None = None

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        del message, peer, now_us
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        served = self._served
        snapshot = served.snapshot
        if snapshot is None:
            return ()
        self._switch(snapshot.channels)
        if now_us >= self._prearm_us:
            self._prearm_us = now_us + _PREARM_EVERY_US
            if not snapshot.armed:
                for reason in served.needs.refusals():
                    served.say(CRITICAL, f"PreArm: {reason}")
        return ()

    def _switch(self, channels: tuple[int, ...]) -> None:
        number = int(self._served.parameters["FLTMODE_CH"])
        low, high = _CHANNEL_US
        if not 0 < number <= len(channels) or not low < channels[number - 1] < high:
            return
        position = sum(channels[number - 1] > end for end in _SWITCHES_US)
        before, self._position = self._position, position
        if before is not None and before != position:
            refusal = self._served.modes.select(int(self._served.parameters[f"FLTMODE{position + 1}"]))
            if refusal is not None:
                self._served.say(CRITICAL, refusal.reason)


def copter_services(served: Served) -> Sequence[Service]:
    return (Greeter(served), VersionRequests(served), Watch(served))
