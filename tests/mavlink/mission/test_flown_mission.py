from math import inf, nan
from typing import Any

import pytest

from colibri.mavlink.mission.items import ACCEPTED, MISSION
from colibri.mavlink.mission.service import MissionProgress
from colibri.mavlink.services.command import DENIED, ReceivedCommand
from colibri.mavlink.wire.dialect import Refusal, mav
from tests.support.mission_ends import FIRST, VEHICLE, Ground, fielded, results, some_item, upload


def test_the_current_item_is_marked() -> None:
    ground = Ground()
    upload(ground)
    ground.progress = MissionProgress(1, mav.MISSION_STATE_ACTIVE, 1)
    replies = [ground.hear(FIRST, "MISSION_REQUEST_INT", *VEHICLE, seq, MISSION)[0] for seq in range(3)]
    assert [reply.fields.current for reply in replies] == [0, 1, 0]


def test_progress_is_sent_once_a_second_and_on_change() -> None:
    ground = Ground()
    (first,) = ground.poll()
    assert list(first.fields)[:4] == [0, 0xFFFF, mav.MISSION_STATE_NO_MISSION, 2]
    said = [len(ground.poll(100_000)) for _ in range(20)]
    assert said == [0] * 9 + [1] + [0] * 9 + [1]
    ground.progress = MissionProgress(4, mav.MISSION_STATE_ACTIVE, 1)
    (message,) = ground.poll(4_000)
    assert (message.fields.seq, message.fields.mission_state, message.fields.mission_mode) == (4, 3, 1)
    assert list(ground.service.current())[:4] == [4, 0xFFFF, 3, 1]
    assert ground.poll(4_000) == []
    ground.service.reached(4)
    (message,) = ground.poll(4_000)
    assert (message.name, message.fields.seq) == ("MISSION_ITEM_REACHED", 4)
    upload(ground)
    (message,) = ground.poll(4_000)
    assert message.fields.total == 3


def test_setting_the_current_item() -> None:
    ground = Ground()
    ground.poll()
    ground.hear(FIRST, "MISSION_SET_CURRENT", *VEHICLE, 5)
    assert ground.set == [(5, False)]
    assert [message.name for message in ground.poll(4_000)] == ["MISSION_CURRENT"]
    ground.refuses = Refusal("no mission")
    (text,) = ground.hear(FIRST, "MISSION_SET_CURRENT", *VEHICLE, 6)
    assert (text.name, ground.poll(4_000)) == ("STATUSTEXT", [])


@pytest.mark.parametrize(
    ("p1", "p2", "expected"),
    [
        (2.0, nan, (2, False)),
        (0.0, 1.0, (0, True)),
        (-1.0, 1.0, (-1, True)),
        (nan, 0.0, None),
        (inf, 0.0, None),
        (1.5, 0.0, None),
        (-2.0, 0.0, (-2, False)),  # the vehicle knows how many there are
        (1.0, 2.0, None),
    ],
)
def test_the_command_to_set_the_current_item(p1: float, p2: float, expected: tuple[int, bool] | None) -> None:
    ground = Ground()
    ground.poll()
    command = ReceivedCommand(mav.MAV_CMD_DO_SET_MISSION_CURRENT, p1, p2, nan, nan, nan, nan, nan, None, FIRST, 0)
    refusal = ground.service.do_set_mission_current(command)
    assert ground.set == ([expected] if expected else [])
    assert (refusal is None) is bool(expected)
    assert refusal is None or refusal.result == DENIED
    assert len(ground.poll(4_000)) == (1 if expected else 0)
    ground.refuses = Refusal("no")
    assert ground.service.do_set_mission_current(command) is not None


def test_a_place_to_fly_to_now() -> None:
    ground = Ground()
    fields = (0, 3, 16, 2, 0, 0, 0, 0, 0, 47.25, 8.5, 20.0)
    assert results(ground.hear(FIRST, "MISSION_ITEM", *VEHICLE, *fields)) == [ACCEPTED]
    answer = ground.hear(FIRST, "MISSION_ITEM_INT", *VEHICLE, 0, *fielded(some_item(), current=2))
    assert results(answer) == [ACCEPTED]
    assert ground.flown_to == [(47.25, 8.5, 20.0, 3), pytest.approx((47.397742, 8.545594, 2.5, 3))]
    ground.guided = Refusal("not flying")
    answers = ground.hear(FIRST, "MISSION_ITEM", *VEHICLE, *fields)
    assert [message.name for message in answers] == ["MISSION_ACK", "STATUSTEXT"]
    assert results(answers) == [mav.MAV_MISSION_DENIED]


@pytest.mark.parametrize(
    ("changes", "result"),
    [
        ({"current": 3}, mav.MAV_MISSION_UNSUPPORTED),
        ({"command": 21}, mav.MAV_MISSION_UNSUPPORTED),
        ({"frame": 1}, mav.MAV_MISSION_UNSUPPORTED_FRAME),
        ({"x": nan}, mav.MAV_MISSION_INVALID_PARAM5_X),
        ({"x": 90.5}, mav.MAV_MISSION_INVALID_PARAM5_X),
        ({"y": -inf}, mav.MAV_MISSION_INVALID_PARAM6_Y),
        ({"z": nan}, mav.MAV_MISSION_INVALID_PARAM7),
    ],
)
def test_no_such_place_to_fly_to(changes: dict[str, Any], result: int) -> None:
    ground = Ground()
    fields = {"frame": 3, "command": 16, "current": 2, "go_on": 0, "x": 47.0, "y": 8.0, "z": 5.0} | changes
    frame, command, current, go_on, x, y, z = fields.values()
    answer = ground.hear(FIRST, "MISSION_ITEM", *VEHICLE, 0, frame, command, current, go_on, 0, 0, 0, 0, x, y, z)
    assert (results(answer), ground.flown_to) == ([result], [])
