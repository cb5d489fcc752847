"""The command protocol: one test a rule of mavlink.io/en/services/command.html."""

from math import isnan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.services.command import (
    ACCEPTED,
    DENIED,
    FAILED,
    IN_PROGRESS,
    PENDING,
    PROGRESS_UNKNOWN,
    REMEMBERED_FOR_US,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    UNSUPPORTED_MAV_FRAME,
    CommandService,
    Handler,
    ReceivedCommand,
)
from colibri.mavlink.services.statustext import ERROR, WARNING, StatusText
from colibri.mavlink.wire.dialect import Message, Refusal, mav
from tests.support.messages import (
    ANY_LONG,
    BYTES,
    FLOATS,
    GROUND,
    INT32,
    NAN,
    OTHER,
    PEERS,
    command_int,
    command_long,
    message,
    on_the_wire,
)

ARM: int = mav.MAV_CMD_COMPONENT_ARM_DISARM
ORBIT: int = mav.MAV_CMD_DO_ORBIT
CALIBRATE: int = mav.MAV_CMD_PREFLIGHT_CALIBRATION


class Vehicle:
    def __init__(self, refusal: Refusal | None = None) -> None:
        self.refusal = refusal
        self.obeyed: list[ReceivedCommand] = []

    def __call__(self, command: ReceivedCommand) -> Refusal | None:
        self.obeyed.append(command)
        return self.refusal


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()


def service_of(handlers: dict[int, Handler]) -> CommandService:
    return CommandService(handlers, StatusText())


def receive(service: CommandService, received: Message, peer: Peer = GROUND, now_us: int = 0) -> list[Send]:
    return list(service.receive(received, peer, now_us))


def acks(sends: list[Send]) -> list[tuple[int | None, int, int]]:
    return [(send.channel, send.fields[0], send.fields[1]) for send in sends if send.name == "COMMAND_ACK"]


def test_a_command_is_acknowledged_to_whoever_sent_it(vehicle: Vehicle) -> None:
    service = service_of({ARM: vehicle})
    (send,) = receive(service, command_long(ARM, 1.0))
    (ack,) = on_the_wire([send])
    assert send.channel == GROUND.channel
    assert (ack.fields.command, ack.fields.result) == (ARM, ACCEPTED)
    assert (ack.fields.target_system, ack.fields.target_component) == (GROUND.system, GROUND.component)
    assert vehicle.obeyed[0].peer == GROUND


def test_an_unknown_command_is_unsupported_at_once(vehicle: Vehicle) -> None:
    service = service_of({ARM: vehicle})
    assert acks(receive(service, command_long(31010))) == [(1, 31010, UNSUPPORTED)]
    assert acks(receive(service, command_int(31010, frame=77))) == [(1, 31010, UNSUPPORTED)]


def test_parameters_of_a_long_come_as_they_are(vehicle: Vehicle) -> None:
    receive(service_of({ORBIT: vehicle}), command_long(ORBIT, 1.0, 2.0, NAN, 4.0, 47.5, 8.25, 488.0), now_us=77)
    (command,) = vehicle.obeyed
    assert (command.p1, command.p2, command.p4, command.x, command.y, command.z) == (1.0, 2.0, 4.0, 47.5, 8.25, 488.0)
    assert isnan(command.p3)
    assert command.frame is None
    assert command.now_us == 77


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10, 11])
def test_global_frames_are_in_degrees(vehicle: Vehicle, frame: int) -> None:
    place = command_int(ORBIT, NAN, 2.0, frame=frame, x=473_977_420, y=-85_455_940, z=488.5)
    receive(service_of({ORBIT: vehicle}), place)
    (command,) = vehicle.obeyed
    assert (command.x, command.y) == pytest.approx((47.397742, -8.545594), abs=1e-9)
    assert (command.z, command.frame) == (488.5, frame)
    assert isnan(command.p1)


def test_a_place_that_is_not_given_is_nan(vehicle: Vehicle) -> None:
    receive(service_of({ORBIT: vehicle}), command_int(ORBIT, frame=5, x=2**31 - 1, y=2**31 - 1, z=NAN))
    (command,) = vehicle.obeyed
    assert isnan(command.x)
    assert isnan(command.y)
    assert isnan(command.z)


@pytest.mark.parametrize("frame", [1, 4, 7, 8, 12, 21, 255])
def test_a_frame_that_a_command_does_not_take_is_refused(vehicle: Vehicle, frame: int) -> None:
    assert acks(receive(service_of({ORBIT: vehicle}), command_int(ORBIT, frame=frame))) == [
        (1, ORBIT, UNSUPPORTED_MAV_FRAME)
    ]
    assert vehicle.obeyed == []


def test_the_mission_frame_names_no_place(vehicle: Vehicle) -> None:
    assert acks(receive(service_of({ORBIT: vehicle}), command_int(ORBIT, frame=2))) == [(1, ORBIT, ACCEPTED)]
    assert isnan(vehicle.obeyed[0].x)


def test_a_command_without_a_place_takes_any_frame(vehicle: Vehicle) -> None:
    receive(service_of({CALIBRATE: vehicle}), command_int(CALIBRATE, frame=1, x=2))
    assert vehicle.obeyed[0].x == 2.0


@pytest.mark.parametrize(("result", "severity"), [(DENIED, WARNING), (TEMPORARILY_REJECTED, WARNING), (FAILED, ERROR)])
def test_a_refusal_says_why_to_all(result: int, severity: int) -> None:
    service = service_of({ARM: Vehicle(Refusal("Arming refused: no battery", result))})
    ack, text = receive(service, command_long(ARM, 1.0))
    assert ack.fields[:4] == (ARM, result, 0, 0)
    assert (text.name, text.channel) == ("STATUSTEXT", None)
    assert text.fields[:2] == (severity, b"Arming refused: no battery")


def test_the_same_reason_is_said_once_a_second() -> None:
    service = service_of({ARM: Vehicle(Refusal("no"))})
    lengths = [len(receive(service, command_long(ARM), now_us=now_us)) for now_us in (0, 500_000, 1_000_000)]
    assert lengths == [2, 1, 2]


def test_a_command_sent_again_is_answered_and_not_obeyed_again(vehicle: Vehicle) -> None:
    vehicle.refusal = Refusal(result=FAILED)
    service = service_of({ARM: vehicle})
    first = receive(service, command_long(ARM, 1.0, NAN))
    vehicle.refusal = None
    for confirmation in (1, 2, 3):
        assert receive(service, command_long(ARM, 1.0, NAN, confirmation=confirmation), now_us=confirmation) == first
    assert len(vehicle.obeyed) == 1


@pytest.mark.parametrize(
    ("confirmation", "again", "peer", "now_us"),
    [
        (0, command_long(ARM, 1.0), GROUND, 1),
        (0, command_long(ARM, 0.0, confirmation=1), GROUND, 1),
        (0, command_long(ARM, 1.0, confirmation=1), OTHER, 1),
        (0, command_long(ARM, 1.0, confirmation=1), GROUND, REMEMBERED_FOR_US),
        (1, command_long(ARM, 1.0, confirmation=1), GROUND, 1),
    ],
    ids=["anew", "other parameters", "another sender", "long after", "one confirmation for all"],
)
def test_what_is_no_repetition_is_obeyed(
    vehicle: Vehicle, confirmation: int, again: Message, peer: Peer, now_us: int
) -> None:
    service = service_of({ARM: vehicle})
    receive(service, command_long(ARM, 1.0, confirmation=confirmation))
    receive(service, again, peer, now_us)
    assert len(vehicle.obeyed) == 2


@pytest.fixture
def calibrating() -> CommandService:
    service = service_of({CALIBRATE: Vehicle(PENDING)})
    assert receive(service, command_long(CALIBRATE, 1.0)) == []
    return service


def told(service: CommandService, until_us: int, step_us: int = 4_000) -> list[Send]:
    return [send for now_us in range(0, until_us + 1, step_us) for send in service.poll(now_us)]


def test_progress_is_told_once_a_second_until_the_end(calibrating: CommandService) -> None:
    sends = told(calibrating, 2_000_000)
    assert [send.fields[1:3] for send in sends] == [(IN_PROGRESS, PROGRESS_UNKNOWN)] * 2
    assert calibrating.finish(CALIBRATE, OTHER, None) == []
    assert acks(calibrating.finish(CALIBRATE, GROUND, None)) == [(1, CALIBRATE, ACCEPTED)]
    assert list(calibrating.poll(9_000_000)) == []
    assert calibrating.finish(CALIBRATE, GROUND, None) == []


def test_the_last_answer_is_remembered(calibrating: CommandService) -> None:
    sends = calibrating.finish(CALIBRATE, GROUND, Refusal("moved", FAILED))
    assert [send.name for send in sends] == ["COMMAND_ACK", "STATUSTEXT"]
    assert acks(receive(calibrating, command_long(CALIBRATE, 1.0, confirmation=1))) == [(1, CALIBRATE, FAILED)]


def test_another_of_its_kind_is_rejected_for_now(calibrating: CommandService) -> None:
    rejected = [(2, CALIBRATE, TEMPORARILY_REJECTED)]
    assert acks(receive(calibrating, command_long(CALIBRATE, 1.0), OTHER)) == rejected
    assert acks(receive(calibrating, command_long(CALIBRATE, 2.0))) == [(1, CALIBRATE, TEMPORARILY_REJECTED)]


def test_the_same_sent_again_hears_how_far_it_is(calibrating: CommandService) -> None:
    (ack,) = receive(calibrating, command_long(CALIBRATE, 1.0, confirmation=1))
    assert ack.fields[1:3] == (IN_PROGRESS, PROGRESS_UNKNOWN)


def test_what_is_cancelled_goes_on(calibrating: CommandService) -> None:
    sends = receive(calibrating, message("COMMAND_CANCEL", 1, 1, CALIBRATE))
    assert acks(sends) == [(1, CALIBRATE, IN_PROGRESS)]
    assert acks(calibrating.finish(CALIBRATE, GROUND, None)) == [(1, CALIBRATE, ACCEPTED)]


def test_there_may_be_nothing_to_cancel(vehicle: Vehicle) -> None:
    service = service_of({CALIBRATE: vehicle})
    assert receive(service, message("COMMAND_CANCEL", 1, 1, CALIBRATE)) == []
    assert receive(service, message("COMMAND_CANCEL", 1, 1, 9999)) == []


def test_progress_survives_a_clock_that_begins_anew(calibrating: CommandService) -> None:
    list(calibrating.poll(50_000_000))
    assert len(list(calibrating.poll(0))) == 1


@given(st.lists(st.tuples(ANY_LONG, PEERS), max_size=20), st.sampled_from(range(9)))
def test_every_long_command_gets_one_answer(received: list[tuple[Message, Peer]], result: int) -> None:
    service = service_of({number: Vehicle(Refusal(result=result)) for number in range(0, 500, 2)})
    for number, (command, peer) in enumerate(received):
        (ack,) = acks(receive(service, command, peer, number))
        assert ack[:2] == (peer.channel, command.fields.command)


@given(BYTES, st.sampled_from([ORBIT, ARM, CALIBRATE, 7]), FLOATS, INT32, INT32, FLOATS)
def test_every_int_command_gets_one_answer(frame: int, number: int, p: float, x: int, y: int, z: float) -> None:
    service = service_of({ORBIT: Vehicle(), ARM: Vehicle(), CALIBRATE: Vehicle()})
    assert len(acks(receive(service, command_int(number, p, frame=frame, x=x, y=y, z=z)))) == 1


def test_memory_has_a_limit(vehicle: Vehicle) -> None:
    service = service_of({ARM: vehicle})
    for system in range(256):
        receive(service, command_long(ARM, 1.0), Peer(1, system, 1))
    receive(service, command_long(ARM, 1.0, confirmation=1), Peer(1, 0, 1))
    receive(service, command_long(ARM, 1.0, confirmation=1), Peer(1, 255, 1))
    assert len(vehicle.obeyed) == 257
