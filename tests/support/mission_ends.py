"""The vehicle's end of the mission protocol, and single messages of ground stations, for tests."""

from collections.abc import Iterable
from struct import pack
from typing import Any

from colibri.mavlink.mission.items import ACCEPTED, MISSION, PLAN_TYPES, MissionItem, StoredPlan
from colibri.mavlink.mission.service import MissionProgress, MissionService, MissionVehicle
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.wire.dialect import Codec, Message, Refusal, mav
from tests.support.messages import message, on_the_wire

VEHICLE = (1, 1)
FIRST = Peer(0, 255, 190)
SECOND = Peer(1, 255, 190)
VALID = Rules(lambda _: ACCEPTED, lambda _: (ACCEPTED, 0))


def some_item(number: int = 0, **changes: Any) -> MissionItem:
    values = (3, 16, 1, 0.5 * number, 1.0, float("nan"), -0.25, 473977420 + number, 85455940 - number, 2.5 + number)
    return MissionItem(*values)._replace(**changes)


ITEMS = [some_item(number) for number in range(3)]


class Ground:
    def __init__(self, rules: Rules = VALID, *, old_form: bool | None = None) -> None:
        self.loaded: list[tuple[int, StoredPlan]] = []
        self.progress = MissionProgress()
        self.set: list[tuple[int, bool]] = []
        self.refuses: Refusal | None = None
        self.flown_to: list[tuple[float, float, float, int]] = []
        self.guided: Refusal | None = None
        vehicle = MissionVehicle(
            lambda plan_type, plan: self.loaded.append((plan_type, plan)),
            lambda: self.progress,
            self._set_current,
            self._guided_goto,
        )
        self.service = MissionService(dict.fromkeys(PLAN_TYPES, rules), vehicle, StatusText(), old_form=old_form)
        self.codec = Codec(*VEHICLE)
        self.now_us = 0

    def _set_current(self, seq: int, reset: bool) -> Refusal | None:
        if self.refuses is None:
            self.set.append((seq, reset))
        return self.refuses

    def _guided_goto(self, latitude: float, longitude: float, altitude: float, frame: int) -> Refusal | None:
        self.flown_to.append((latitude, longitude, altitude, frame))
        return self.guided

    def hear(self, peer: Peer, name: str, *fields: Any) -> list[Message]:
        return on_the_wire(self.service.receive(message(name, *fields, peer=peer), peer, self.now_us))

    def poll(self, after_us: int = 0) -> list[Message]:
        self.now_us += after_us
        return on_the_wire(self.service.poll(self.now_us))


def fielded(item: MissionItem, plan_type: int = 0, current: int = 0) -> tuple[Any, ...]:
    return (item.frame, item.command, current, *item[2:], plan_type)


def results(messages: Iterable[Message]) -> list[int]:
    return [message.fields.type for message in messages if message.name == "MISSION_ACK"]


def asked(messages: Iterable[Message]) -> list[tuple[str, int]]:
    names = ("MISSION_REQUEST_INT", "MISSION_REQUEST")
    return [(message.name, message.fields.seq) for message in messages if message.name in names]


CANCELLED: int = mav.MAV_MISSION_OPERATION_CANCELLED


def count(ground: Ground, number: int, peer: Any = FIRST, plan_type: int = MISSION) -> list[Any]:
    return ground.hear(peer, "MISSION_COUNT", *VEHICLE, number, plan_type)


def give(ground: Ground, seq: int, item: MissionItem, peer: Any = FIRST, plan_type: int = MISSION) -> list[Any]:
    return ground.hear(peer, "MISSION_ITEM_INT", *VEHICLE, seq, *fielded(item, plan_type))


def upload(ground: Ground, items: Any = ITEMS, plan_type: int = MISSION) -> list[Any]:
    answers = count(ground, len(items), plan_type=plan_type)
    for seq, item in enumerate(items):
        assert asked(answers) == [("MISSION_REQUEST_INT", seq)]
        answers = give(ground, seq, item, plan_type=plan_type)
    return answers


def bits(items: Any) -> list[bytes]:
    return [pack("<BHBffffiif", *item) for item in items]
