"""A ground station of pymavlink alone: takes a plan up and down over a bad link, saying again what is not answered.

https://mavlink.io/en/services/mission.html
"""

import socket
from collections.abc import Sequence
from select import select
from time import monotonic
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import common

Item: TypeAlias = tuple[Any, ...]
"""frame, command, autocontinue, four parameters, x, y, z."""

MISSION: int = common.MAV_MISSION_TYPE_MISSION
ACCEPTED: int = common.MAV_MISSION_ACCEPTED
_AGAIN_AFTER_S = 0.02
_GIVE_UP_AFTER_S = 60.0
_VEHICLE = (1, 1)


class PlanClient:
    """A ground station.

    Attributes:
        said_again: How often it had to say something again.
    """

    def __init__(self, url: str) -> None:
        """Call the vehicle at `url`."""
        _, host, port = url.split(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((host, int(port)))
        self._mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser = common.MAVLink(None)
        self._parser.robust_parsing = True
        self._last = b""
        self.said_again = 0

    def close(self) -> None:
        """Hang up."""
        self._socket.close()

    def upload(self, items: Sequence[Item]) -> int:
        """Give the vehicle a mission; return its answer, a MAV_MISSION_RESULT."""
        self._say(common.MAVLink_mission_count_message(*_VEHICLE, len(items), MISSION))
        while True:
            answer = self._hear("MISSION_REQUEST_INT", "MISSION_ACK")
            if answer.get_type() == "MISSION_ACK":
                return int(answer.type)
            frame, command, on, *parameters, x, y, z = items[answer.seq]
            fields = (answer.seq, frame, command, 0, on, *parameters, x, y, z, MISSION)
            self._say(common.MAVLink_mission_item_int_message(*_VEHICLE, *fields))

    def download(self) -> list[Item]:
        """Return the vehicle's mission."""
        self._say(common.MAVLink_mission_request_list_message(*_VEHICLE, MISSION))
        count = self._hear("MISSION_COUNT").count
        items: list[Item] = []
        while len(items) < count:
            self._say(common.MAVLink_mission_request_int_message(*_VEHICLE, len(items), MISSION))
            item = self._hear("MISSION_ITEM_INT")
            while item.seq != len(items):  # a copy that came late
                item = self._hear("MISSION_ITEM_INT")
            parameters = (item.param1, item.param2, item.param3, item.param4)
            items.append((item.frame, item.command, item.autocontinue, *parameters, item.x, item.y, item.z))
        self._say(common.MAVLink_mission_ack_message(*_VEHICLE, ACCEPTED, MISSION))
        return items

    def _say(self, message: Any) -> None:
        self._last = message.pack(self._mav)
        self._socket.send(self._last)

    def _hear(self, *names: str) -> Any:
        """Return the next message of the mission protocol with one of `names`; say the last word again meanwhile."""
        give_up_s = monotonic() + _GIVE_UP_AFTER_S
        again_s = monotonic() + _AGAIN_AFTER_S
        while (now_s := monotonic()) < give_up_s:
            if now_s >= again_s:
                self.said_again += 1
                self._socket.send(self._last)
                again_s = now_s + _AGAIN_AFTER_S
            if not select([self._socket], [], [], again_s - now_s)[0]:
                continue
            for message in self._parser.parse_buffer(self._socket.recv(4096)) or ():
                if message.get_type() in names and message.mission_type == MISSION:
                    return message
        raise TimeoutError(f"none of {names}")
