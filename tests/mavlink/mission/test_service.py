"""The mission protocol, message by message: https://mavlink.io/en/services/mission.html."""

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.mission.items import ACCEPTED, FENCE, MISSION, NO_PLAN, RALLY, MissionItem
from colibri.mavlink.mission.upload import GIVES_WAY_AFTER_US, Rules
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import Codec, mav
from tests.support.messages import on_the_wire
from tests.support.mission_ends import (
    CANCELLED,
    FIRST,
    ITEMS,
    SECOND,
    VEHICLE,
    Ground,
    asked,
    bits,
    count,
    give,
    results,
    some_item,
    upload,
)

FLOATS = st.floats(width=32)


def download(ground: Ground, plan_type: int, name: str = "MISSION_REQUEST_INT") -> list[MissionItem]:
    (answer,) = ground.hear(FIRST, "MISSION_REQUEST_LIST", *VEHICLE, plan_type)
    items = []
    for seq in range(answer.fields.count):
        (reply,) = ground.hear(FIRST, name, *VEHICLE, seq, plan_type)
        assert (reply.name, reply.fields.seq, reply.fields.mission_type) == ("MISSION_ITEM_INT", seq, plan_type)
        values = list(reply.fields)
        items.append(MissionItem(values[3], values[4], values[6], *values[7:14]))
    return items


@given(
    st.lists(
        st.builds(
            MissionItem,
            st.integers(0, 255),
            st.integers(0, 65535),
            st.integers(0, 255),
            *[FLOATS] * 4,
            *[st.integers(-(2**31), 2**31 - 1)] * 2,
            FLOATS,
        ),
        min_size=1,
        max_size=4,
    ),
    st.sampled_from([MISSION, FENCE, RALLY]),
    st.sampled_from(["MISSION_REQUEST_INT", "MISSION_REQUEST"]),
)
def test_a_download_is_the_upload_bit_for_bit(items: list[MissionItem], plan_type: int, name: str) -> None:
    ground = Ground()
    (answer,) = upload(ground, items, plan_type)
    plan = ground.service.plans[plan_type]
    assert (answer.fields.type, answer.fields.mission_type) == (ACCEPTED, plan_type)
    assert answer.fields.opaque_id == plan.id != 0
    assert ground.loaded == [(plan_type, plan)]
    assert bits(download(ground, plan_type, name)) == bits(items)


def test_ids_are_told_and_change_with_the_items() -> None:
    ground = Ground()
    upload(ground, ITEMS)
    (answer,) = ground.hear(FIRST, "MISSION_REQUEST_LIST", *VEHICLE, MISSION)
    first = answer.fields.opaque_id
    upload(ground, [*ITEMS[:-1], ITEMS[-1]._replace(p4=1.0)])
    upload(ground, ITEMS, FENCE)
    (current,) = [message for message in ground.poll() if message.name == "MISSION_CURRENT"]
    ids = (current.fields.mission_id, current.fields.fence_id, current.fields.rally_points_id)
    assert ids == (ground.service.plans[MISSION].id, first, 0)
    assert ids[0] not in (0, first)


def test_an_old_reader_sees_the_later_fields_cut_off() -> None:
    """The dialect that is installed does not know opaque ids; the checksum must hold for it all the same."""
    ground = Ground()
    frame = ground.codec.encode("MISSION_ACK", 255, 190, 0, 1, 0xDEADBEEF)
    decoded = mav.MAVLink(None).decode(bytearray(frame))
    assert (decoded.target_system, decoded.type, decoded.mission_type) == (255, 0, 1)


def test_a_lost_item_is_requested_again_every_250_ms() -> None:
    ground = Ground()
    count(ground, 3)
    give(ground, 0, ITEMS[0])
    ground.poll()
    assert asked(ground.poll(249_000)) == []
    assert asked(ground.poll(1_000)) == [("MISSION_REQUEST_INT", 1)]
    assert asked(ground.poll(249_000)) == []
    assert asked(ground.poll(1_000)) == [("MISSION_REQUEST_INT", 1)]
    assert asked(give(ground, 1, ITEMS[1])) == [("MISSION_REQUEST_INT", 2)]


def test_an_abandoned_upload_keeps_the_old_plan() -> None:
    ground = Ground()
    upload(ground, ITEMS)
    plan = ground.service.plans[MISSION]
    count(ground, 2)
    give(ground, 0, some_item(9))
    said = [message for _ in range(60) for message in ground.poll(100_000)]
    assert results(said) == [CANCELLED]
    assert len(asked(said)) > 5
    assert ground.service.plans[MISSION] is plan
    assert results(give(ground, 1, some_item(9))) == []
    assert results(upload(ground, ITEMS[:1])) == [ACCEPTED]


def test_an_upload_followed_by_a_download_ends_silently() -> None:
    """MAVSDK ends its download at any MISSION_ACK."""
    ground = Ground()
    count(ground, 2)
    ground.hear(FIRST, "MISSION_REQUEST_LIST", *VEHICLE, FENCE)
    assert results(message for _ in range(60) for message in ground.poll(100_000)) == []
    assert results(upload(ground)) == [ACCEPTED]


def test_items_out_of_sequence_are_dropped_and_copies_ignored() -> None:
    ground = Ground()
    count(ground, 3)
    assert asked(give(ground, 2, ITEMS[2])) == [("MISSION_REQUEST_INT", 0)]
    give(ground, 0, ITEMS[0])
    assert give(ground, 0, some_item(7)) == []
    give(ground, 1, ITEMS[1])
    assert results(give(ground, 2, ITEMS[2])) == [ACCEPTED]
    assert bits(ground.service.plans[MISSION].items) == bits(ITEMS)


def test_a_repeated_count_begins_again() -> None:
    ground = Ground()
    count(ground, 3)
    assert asked(count(ground, 3)) == [("MISSION_REQUEST_INT", 0)]
    give(ground, 0, some_item(8))
    assert asked(count(ground, 2)) == [("MISSION_REQUEST_INT", 0)]
    for seq in (0, 1):
        answer = give(ground, seq, ITEMS[seq])
    assert results(answer) == [ACCEPTED]
    assert bits(ground.service.plans[MISSION].items) == bits(ITEMS[:2])


def test_a_lost_ack_is_repeated_for_the_last_item_only() -> None:
    ground = Ground()
    upload(ground)
    assert give(ground, 2, ITEMS[2]) == []  # a copy that the link made
    ground.poll(300_000)
    assert give(ground, 1, ITEMS[1]) == []
    assert give(ground, 2, ITEMS[2], SECOND) == []
    assert results(give(ground, 2, ITEMS[2])) == [ACCEPTED]
    assert len(ground.loaded) == 1


def test_a_second_station_is_denied_while_the_first_uploads() -> None:
    ground = Ground()
    count(ground, 2)
    assert results(count(ground, 2, SECOND)) == [mav.MAV_MISSION_DENIED]
    assert give(ground, 0, ITEMS[0], SECOND) == []
    assert asked(count(ground, 2, SECOND, FENCE)) == [("MISSION_REQUEST_INT", 0)]
    assert asked(give(ground, 0, ITEMS[0])) == [("MISSION_REQUEST_INT", 1)]
    assert results(give(ground, 1, ITEMS[1])) == [ACCEPTED]
    assert asked(count(ground, 2, SECOND)) == [("MISSION_REQUEST_INT", 0)]


def test_an_upload_that_begins_again_and_again_gives_way() -> None:
    ground = Ground()
    for ground.now_us in range(0, GIVES_WAY_AFTER_US, 4_000_000):
        count(ground, 2)
        assert results(count(ground, 2, SECOND)) == [mav.MAV_MISSION_DENIED]
    ground.now_us = GIVES_WAY_AFTER_US
    assert asked(count(ground, 2, SECOND)) == [("MISSION_REQUEST_INT", 0)]
    assert results(count(ground, 2)) == [mav.MAV_MISSION_DENIED]


def test_no_space_and_nothing_at_all() -> None:
    ground = Ground()
    upload(ground)
    assert results(count(ground, 1001)) == [mav.MAV_MISSION_NO_SPACE]
    assert len(ground.service.plans[MISSION].items) == 3
    assert results(count(ground, 0)) == [ACCEPTED]
    assert ground.service.plans[MISSION] is NO_PLAN
    assert asked(count(ground, 1000)) == [("MISSION_REQUEST_INT", 0)]


@pytest.mark.parametrize("plan_type", [3, 254, 255])
def test_other_types_and_partial_lists_are_unsupported(plan_type: int) -> None:
    ground = Ground()
    for name, fields in (
        ("MISSION_COUNT", (3, plan_type)),
        ("MISSION_REQUEST_LIST", (plan_type,)),
        ("MISSION_REQUEST_INT", (0, plan_type)),
    ):
        answer, text = ground.hear(FIRST, name, *VEHICLE, *fields)
        assert text.fields.text == f"{'all plans' if plan_type == 255 else f'plan type {plan_type}'} refused: not known"
        assert (answer.fields.type, answer.fields.mission_type) == (mav.MAV_MISSION_UNSUPPORTED, plan_type)
    for name in ("MISSION_WRITE_PARTIAL_LIST", "MISSION_REQUEST_PARTIAL_LIST"):
        assert results(ground.hear(FIRST, name, *VEHICLE, 0, 1, 0)) == [mav.MAV_MISSION_UNSUPPORTED]


def test_a_refused_item_keeps_the_old_plan() -> None:
    picky = Rules(lambda item: 9 * (item.p1 == 0.5), lambda items: (13 * (len(items) == 1), 0))
    ground = Ground(picky)
    count(ground, 3)
    give(ground, 0, ITEMS[0])
    assert results(give(ground, 1, ITEMS[1])) == [9]
    assert give(ground, 2, ITEMS[2]) == []
    ground.poll(300_000)
    assert results(give(ground, 1, ITEMS[1])) == [9]  # its acknowledgement was lost
    count(ground, 1)
    answer, text = give(ground, 0, ITEMS[0])
    assert (answer.fields.type, answer.fields.opaque_id) == (13, 0)
    assert text.fields.text == "mission item 0: NAV_WAYPOINT (16)"
    assert ground.loaded == []


@pytest.mark.parametrize("result", [CANCELLED, mav.MAV_MISSION_ERROR, mav.MAV_MISSION_UNSUPPORTED])
def test_the_station_cancels_an_upload(result: int) -> None:
    ground = Ground()
    count(ground, 2)
    assert ground.hear(SECOND, "MISSION_ACK", *VEHICLE, result, MISSION) == []
    assert ground.hear(FIRST, "MISSION_ACK", *VEHICLE, ACCEPTED, MISSION) == []
    assert asked(ground.poll(250_000)) != []
    assert ground.hear(FIRST, "MISSION_ACK", *VEHICLE, result, MISSION) == []
    assert asked(ground.poll(250_000)) == []
    assert asked(count(ground, 2, SECOND)) != []


def test_a_station_that_knows_only_the_old_messages() -> None:
    """As DroneKit: it answers MISSION_REQUEST with floats in degrees."""
    ground = Ground()
    waiting = count(ground, 2)
    for seq in range(2):
        for _ in range(10):
            if ("MISSION_REQUEST", seq) in asked(waiting):
                break
            waiting = ground.poll(250_000)
        fields = (seq, 3, 16, 0, 1, 0, 0, 0, 0, 47.5, -8.25, 20.0 + seq)
        waiting = ground.hear(FIRST, "MISSION_ITEM", *VEHICLE, *fields)
        if seq == 0:
            assert asked(waiting) == [("MISSION_REQUEST", 1)]  # at once
    assert results(waiting) == [ACCEPTED]
    places = [item[7:] for item in ground.service.plans[MISSION].items]
    assert places == [(475000000, -82500000, 20.0), (475000000, -82500000, 21.0)]


def test_old_requests_are_answered_with_degrees() -> None:
    """As ArduPilot, whose clients replace a mission and read it back at once."""
    ground = Ground(old_form=True)
    for latitude in (47.5, 48.5):
        count(ground, 2)
        for seq in range(2):
            ground.hear(FIRST, "MISSION_ITEM", *VEHICLE, seq, 3, 16, 0, 1, 0, 0, 0, 0, latitude, -8.25, 20.0)
        (item,) = ground.hear(FIRST, "MISSION_REQUEST", *VEHICLE, 1, MISSION)
        assert (item.name, item.fields.x, item.fields.y) == ("MISSION_ITEM", pytest.approx(latitude), -8.25)
        ground.hear(FIRST, "MISSION_REQUEST_LIST", *VEHICLE, MISSION)


def test_a_nack_of_the_old_request_switches_to_the_new_one() -> None:
    """As MAVSDK."""
    ground = Ground()
    count(ground, 1)
    said = [message for _ in range(2) for message in ground.poll(250_000)]
    assert ("MISSION_REQUEST", 0) in asked(said)
    answer = ground.hear(FIRST, "MISSION_ACK", *VEHICLE, mav.MAV_MISSION_UNSUPPORTED, MISSION)
    assert asked(answer) == [("MISSION_REQUEST_INT", 0)]
    said = [message for _ in range(8) for message in ground.poll(250_000)]
    assert set(asked(said)) == {("MISSION_REQUEST_INT", 0)}
    assert results(give(ground, 0, ITEMS[0])) == [ACCEPTED]


@pytest.mark.parametrize(
    ("frame", "x", "y", "expected"),
    [
        (2, 7.0, -3.0, (7, -3)),
        (3, nan, 1.0, (NOT_GIVEN, 10000000)),
        (3, inf, 1.0, mav.MAV_MISSION_INVALID_PARAM5_X),
        (3, 1.0, 3e38, mav.MAV_MISSION_INVALID_PARAM6_Y),
    ],
)
def test_places_of_old_items(frame: int, x: float, y: float, expected: Any) -> None:
    ground = Ground()
    count(ground, 1)
    answer = ground.hear(FIRST, "MISSION_ITEM", *VEHICLE, 0, frame, 16, 0, 1, 0, 0, 0, 0, x, y, 0)
    if isinstance(expected, int):
        assert results(answer) == [expected]
    else:
        assert ground.service.plans[MISSION].items[0][7:9] == expected


def test_clearing() -> None:
    ground = Ground()
    for plan_type in (MISSION, FENCE, RALLY):
        upload(ground, ITEMS, plan_type)
    (answer,) = ground.hear(FIRST, "MISSION_CLEAR_ALL", *VEHICLE, FENCE)
    assert (answer.fields.type, answer.fields.mission_type) == (ACCEPTED, FENCE)
    assert [bool(plan.items) for plan in ground.service.plans.values()] == [True, False, True]
    assert results(ground.hear(FIRST, "MISSION_CLEAR_ALL", *VEHICLE, 255)) == [ACCEPTED]
    assert set(ground.service.plans.values()) == {NO_PLAN}
    assert results(ground.hear(FIRST, "MISSION_CLEAR_ALL", *VEHICLE, 7)) == [mav.MAV_MISSION_UNSUPPORTED]
    (answer,) = ground.hear(FIRST, "MISSION_REQUEST_LIST", *VEHICLE, MISSION)
    assert (answer.fields.count, answer.fields.opaque_id) == (0, 0)


def test_version_1_frames_are_about_the_mission() -> None:
    ground = Ground()
    old = mav.MAVLink(None, srcSystem=255, srcComponent=190)
    frame = mav.MAVLink_mission_count_message(1, 1, 2, 0).pack(old, force_mavlink1=True)
    (message,) = Codec(1, 1).decode(frame)
    answers = on_the_wire(ground.service.receive(message, FIRST, 0))
    assert asked(answers) == [("MISSION_REQUEST_INT", 0)]
