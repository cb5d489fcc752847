import random

import pytest

from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep import (
    CALL_AFTER_S,
    FREE_RUNNING,
    PEER_GIVEN_UP_AFTER_S,
    PEER_LOST_AFTER_S,
    RESEND_AFTER_S,
    encode_heartbeat,
)
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.plant_status import ReceivedFrame
from colibri.mavlink.hil.sensors import Frame, GpsFix, SensorFrame, encode_sensors
from colibri.mavlink.hil.state import encode_actuators
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec
from tests.support.lockstep_ends import ADDRESS, INTERVAL_US, STRANGER, answer_to, call, command_at, frame_at, offered


def test_a_frame_is_answered_once(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer = answer_to(plant, autopilot, 0)
    plant.received.clear()
    assert plant.receive(answer, ADDRESS, 0.0) == command_at(0)
    assert b"".join(plant.received) == answer
    assert plant.receive(answer, ADDRESS, 0.0) is None
    plant.offer(frame_at(INTERVAL_US), 0.0)
    assert plant.receive(answer, ADDRESS, 0.0) is None
    assert plant.dropped["repeated"] == 2


def test_a_repeated_frame_gets_the_remembered_answer(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer = answer_to(plant, autopilot, 0)
    assert plant.poll(0.9 * RESEND_AFTER_S) == pytest.approx(RESEND_AFTER_S)
    assert plant.take_outbox() == []
    plant.poll(RESEND_AFTER_S)
    (again,) = plant.take_outbox()
    assert autopilot.receive(again.datagram, 0.03) is None
    assert autopilot.take_outbox() == [answer]
    assert (plant.resent, autopilot.repeated) == (1, 1)


@pytest.mark.parametrize("time_us", [2 * INTERVAL_US, INTERVAL_US + 1000, 77 * INTERVAL_US])
def test_a_frame_out_of_step_is_dropped(plant: PlantEnd, autopilot: AutopilotEnd, time_us: int) -> None:
    call(autopilot, plant)
    answer_to(plant, autopilot, 0)
    assert autopilot.receive(offered(plant, frame_at(time_us)), 0.5) is None
    assert autopilot.dropped["out of step"] == 1


@pytest.mark.parametrize("time_us", [0, INTERVAL_US, 4 * INTERVAL_US, 77 * INTERVAL_US])
def test_only_the_first_frame_after_silence_begins_a_new_flight(
    plant: PlantEnd, autopilot: AutopilotEnd, time_us: int
) -> None:
    call(autopilot, plant)
    for before_us in (0, INTERVAL_US, 2 * INTERVAL_US):
        answer_to(plant, autopilot, before_us)
    datagram = offered(plant, frame_at(time_us))
    assert autopilot.receive(datagram, 0.5) is None
    begun = ReceivedFrame(frame_at(0)) if time_us == 0 else None
    assert autopilot.receive(datagram, CALL_AFTER_S) == begun
    assert autopilot.receive(datagram, 10.0 * CALL_AFTER_S) is None


def test_a_heartbeat_in_flight_does_not_end_lockstep(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer_to(plant, autopilot, 0)
    forged = encode_heartbeat(Codec(1, dialect.PLANT_COMPONENT), 0, 0, armed=False, custom_mode=FREE_RUNNING)
    assert autopilot.receive(forged, 0.5) is None
    assert autopilot.receive(offered(plant, frame_at(5 * INTERVAL_US)), 0.5) is None


def test_the_autopilot_calls_again_after_silence(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer_to(plant, autopilot, 0)
    assert autopilot.poll(0.5) == CALL_AFTER_S
    assert autopilot.take_outbox() == []
    autopilot.poll(CALL_AFTER_S)
    assert len(autopilot.take_outbox()) == 1


@pytest.mark.parametrize(("silence_s", "is_there", "refused"), [
    (0.9 * PEER_LOST_AFTER_S, False, True),
    (1.1 * PEER_LOST_AFTER_S, False, False),
    (1.1 * PEER_LOST_AFTER_S, True, True),
    (0.9 * PEER_GIVEN_UP_AFTER_S, True, True),
    (PEER_GIVEN_UP_AFTER_S, True, False),
])  # fmt: skip
def test_a_second_autopilot_is_refused_while_the_first_is_there(
    autopilot: AutopilotEnd, silence_s: float, is_there: bool, refused: bool
) -> None:
    plant = PlantEnd(system_id=1, frame_interval_us=4_000, is_there=lambda address: is_there and address == ADDRESS)
    call(autopilot, plant)
    second = AutopilotEnd(system_id=1, frame_interval_us=4_000, now_s=0.0)
    second.poll(0.0)
    (hello,) = second.take_outbox()
    plant.receive(hello, STRANGER, silence_s)
    assert plant.peer == (ADDRESS if refused else STRANGER)
    assert plant.frame_interval_us == (INTERVAL_US if refused else 4_000)
    assert plant.notes == ["a second autopilot calls from port 2: refused, as the first is there"] * refused


def test_a_restarted_autopilot_gets_the_frame_awaited_at_once(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    plant.offer(frame_at(INTERVAL_US), 0.0)
    plant.take_outbox()
    restarted = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=5.0)
    restarted.poll(5.0)
    (hello,) = restarted.take_outbox()
    plant.receive(hello, STRANGER, 5.0)
    frames = [restarted.receive(outgoing.datagram, 5.0) for outgoing in plant.take_outbox()]
    assert ReceivedFrame(frame_at(INTERVAL_US)) in frames


@pytest.mark.parametrize(
    ("interval_us", "flying", "result"),
    [
        (2_000.0, False, dialect.RESULT_ACCEPTED),
        (2_500.0, False, dialect.RESULT_DENIED),
        (0.0, False, dialect.RESULT_DENIED),
        (-1.0, False, dialect.RESULT_DENIED),
        (float("nan"), False, dialect.RESULT_DENIED),
        (float("inf"), False, dialect.RESULT_DENIED),
        (2_000_000.0, False, dialect.RESULT_DENIED),
        (2_000.0, True, dialect.RESULT_TEMPORARILY_REJECTED),
        (4_000.0, True, dialect.RESULT_ACCEPTED),
    ],
)
def test_frame_interval_requests(plant: PlantEnd, interval_us: float, flying: bool, result: int) -> None:
    if flying:
        plant.offer(frame_at(0), 0.0)
    assert asked_for(plant, dialect.MSG_ATTITUDE_QUATERNION, interval_us) == result


def asked_for(plant: PlantEnd, message_id: int, interval_us: float) -> int:
    codec = Codec(1, dialect.AUTOPILOT_COMPONENT)
    target = (1, dialect.PLANT_COMPONENT)
    fields = (*target, dialect.CMD_SET_MESSAGE_INTERVAL, 0, message_id, interval_us, 0, 0, 0, 0, 0)
    plant.take_outbox()
    plant.receive(codec.encode("COMMAND_LONG", *fields), ADDRESS, 0.0)
    (outgoing,) = plant.take_outbox()
    (ack,) = codec.decode(outgoing.datagram)
    assert ack.fields.command == dialect.CMD_SET_MESSAGE_INTERVAL
    result: int = ack.fields.result
    return result


SENSORS, STATE = dialect.MSG_HIL_SENSOR, dialect.MSG_ATTITUDE_QUATERNION


def sensors_at(time_us: int) -> SensorFrame:
    fix = GpsFix(time_us, 3, DEFAULT_ORIGIN, (1.0, 0.5, 0.25), 0.5, 1.0, 9)
    now = float(time_us % 1024)
    vectors = ((now, 0.5, 9.75), (0.0, now, -0.5), (0.25, 0.0, now))
    return SensorFrame(time_us, 0x3F, *vectors, 51_200.0, 15.0, fix if time_us // INTERVAL_US % 2 else None)


def both_ends_on_sensors() -> tuple[PlantEnd, AutopilotEnd]:
    plant = PlantEnd(system_id=1, frame_interval_us=4_000, serves=list(Feedback))
    autopilot = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=0.0, feedback=Feedback.SENSORS)
    call(autopilot, plant)
    return plant, autopilot


def test_the_call_asks_for_sensors() -> None:
    plant, autopilot = both_ends_on_sensors()
    assert (plant.feedback, plant.frame_interval_us) == (Feedback.SENSORS, INTERVAL_US)
    assert autopilot.refused is None


def test_a_plant_without_sensors_refuses_them(plant: PlantEnd) -> None:
    autopilot = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=0.0, feedback=Feedback.SENSORS)
    call(autopilot, plant)
    assert autopilot.refused == dialect.RESULT_UNSUPPORTED
    assert plant.feedback is Feedback.STATE


def test_feedback_is_not_changed_in_mid_flight() -> None:
    plant, _ = both_ends_on_sensors()
    assert asked_for(plant, STATE, INTERVAL_US) == dialect.RESULT_ACCEPTED
    assert asked_for(plant, SENSORS, INTERVAL_US) == dialect.RESULT_ACCEPTED
    plant.offer(sensors_at(0), 0.0)
    assert asked_for(plant, STATE, INTERVAL_US) == dialect.RESULT_TEMPORARILY_REJECTED
    assert asked_for(plant, SENSORS, 2 * INTERVAL_US) == dialect.RESULT_TEMPORARILY_REJECTED
    assert asked_for(plant, SENSORS, INTERVAL_US) == dialect.RESULT_ACCEPTED
    assert plant.feedback is Feedback.SENSORS


def test_frames_of_the_other_kind_are_not_flown_on(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    assert autopilot.receive(offered(plant, sensors_at(INTERVAL_US)), 0.0) is None
    assert autopilot.dropped["unexpected"] == 2
    plant, on_sensors = both_ends_on_sensors()
    assert on_sensors.receive(offered(plant, frame_at(0)), 0.0) is None
    assert on_sensors.dropped["unexpected"] == 2


def test_a_fix_without_a_frame_is_dropped() -> None:
    _, autopilot = both_ends_on_sensors()
    _, fix = encode_sensors(Codec(1, dialect.PLANT_COMPONENT), sensors_at(INTERVAL_US))
    assert autopilot.receive(fix, 0.0) is None
    assert autopilot.dropped["invalid"] == 1


@pytest.mark.parametrize("source", [(2, dialect.AUTOPILOT_COMPONENT), (1, 42)])
def test_a_foreign_command_is_not_obeyed(plant: PlantEnd, autopilot: AutopilotEnd, source: tuple[int, int]) -> None:
    call(autopilot, plant)
    plant.offer(frame_at(0), 0.0)
    assert plant.receive(encode_actuators(Codec(*source), command_at(0)), ADDRESS, 0.0) is None
    assert plant.dropped["foreign"] == 1


def test_a_command_from_another_address_is_not_obeyed(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer = answer_to(plant, autopilot, 0)
    assert plant.receive(answer, STRANGER, 0.0) is None
    assert plant.receive(answer, ADDRESS, 0.0) == command_at(0)


def test_heartbeats_count_in_simulated_time(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    codec = Codec(99, 99)
    beats = {"plant": 0, "autopilot": 0}
    for sample in range(31):
        time_us = sample * INTERVAL_US
        plant.offer(frame_at(time_us), 0.0)
        (outgoing,) = plant.take_outbox()
        beats["plant"] += [message.name for message in codec.decode(outgoing.datagram)].count("HEARTBEAT")
        assert autopilot.receive(outgoing.datagram, 0.0) is not None
        autopilot.answer(command_at(time_us))
        (answer,) = autopilot.take_outbox()
        beats["autopilot"] += [message.name for message in codec.decode(answer)].count("HEARTBEAT")
    assert beats == {"plant": 4, "autopilot": 4}


@pytest.mark.parametrize("feedback", Feedback)
@pytest.mark.parametrize("seed", range(10))
def test_loss_duplication_and_reordering_change_nothing(seed: int, feedback: Feedback) -> None:
    flown_over_a_bad_link(seed, feedback, ahead=0)


@pytest.mark.parametrize("feedback", Feedback)
@pytest.mark.parametrize("seed", range(10))
def test_answers_ahead_change_nothing_over_a_bad_link(seed: int, feedback: Feedback) -> None:
    flown_over_a_bad_link(seed, feedback, ahead=2)


def flown_over_a_bad_link(seed: int, feedback: Feedback, *, ahead: int) -> None:
    chance = random.Random(seed)
    tell = frame_at if feedback is Feedback.STATE else sensors_at
    plant = PlantEnd(system_id=1, frame_interval_us=4_000, serves=list(Feedback))
    autopilot = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=0.0, feedback=feedback)
    call(autopilot, plant)
    obeyed: list[int] = []
    computed: list[Frame] = []
    in_flight: list[tuple[str, bytes]] = []

    def post(to: str, datagram: bytes) -> None:
        for _ in range(chance.choices((0, 1, 2), (0.2, 0.7, 0.1))[0]):
            in_flight.insert(chance.randint(0, len(in_flight)), (to, datagram))

    now_s = 0.0
    plant.offer(tell(0), now_s)
    while len(obeyed) < 50:
        now_s += 0.001
        plant.poll(now_s)
        for outgoing in plant.take_outbox():
            post("autopilot", outgoing.datagram)
        if in_flight:
            to, datagram = in_flight.pop()
            if to == "plant":
                command = plant.receive(datagram, ADDRESS, now_s)
                while command:
                    obeyed.append(command.time_us)
                    command = plant.ahead(command.time_us + INTERVAL_US)
                    if command is None or feedback is Feedback.SENSORS:
                        plant.offer(tell(obeyed[-1] + INTERVAL_US), now_s)
            else:
                received = autopilot.receive(datagram, now_s)
                if received:
                    computed.append(received.frame)
                    due = received.frame.time_us % ((ahead + 1) * INTERVAL_US) == 0
                    command = command_at(received.frame.time_us)
                    autopilot.answer(command._replace(frames=ahead + 1) if due else command)
        for datagram in autopilot.take_outbox():
            post("plant", datagram)
    assert obeyed == [sample * INTERVAL_US for sample in range(len(obeyed))]
    every = 1 if feedback is Feedback.SENSORS else ahead + 1
    assert computed[:16] == [tell(time_us) for time_us in obeyed[::every]][:16]


def test_a_plant_that_sends_a_frame_answered_ahead_is_answered_again(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer_to(plant, autopilot, 0)
    assert not autopilot.may_answer_ahead(2 * INTERVAL_US)  # after a frame with a heartbeat
    plant.offer(frame_at(INTERVAL_US), 0.0)
    (outgoing,) = plant.take_outbox()
    assert autopilot.receive(outgoing.datagram, 0.0)
    assert autopilot.may_answer_ahead(2 * INTERVAL_US)
    assert not autopilot.may_answer_ahead(5 * INTERVAL_US)  # its frame tells of the battery
    answer = command_at(INTERVAL_US)._replace(frames=2)
    autopilot.answer(answer)
    (both,) = autopilot.take_outbox()
    assert autopilot.receive(outgoing.datagram, 0.0) is None
    assert autopilot.take_outbox() == [both]
    assert plant.receive(both, ADDRESS, 0.0) == answer
    assert plant.received[-1] == both
    assert plant.ahead(3 * INTERVAL_US) is None
    assert plant.ahead(2 * INTERVAL_US) == command_at(2 * INTERVAL_US)
    assert autopilot.receive(offered(plant, frame_at(2 * INTERVAL_US)), 0.0) is None
    assert autopilot.take_outbox() == [both]
    assert plant.receive(both, ADDRESS, 0.0) == command_at(2 * INTERVAL_US)


def test_a_command_of_other_frames_is_no_answer(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    answer_to(plant, autopilot, 0)
    plant.offer(frame_at(INTERVAL_US), 0.0)
    for other in (command_at(INTERVAL_US - 1000), command_at(0)._replace(frames=9), command_at(0)):
        assert plant.receive(encode_actuators(Codec(1, dialect.AUTOPILOT_COMPONENT), other), ADDRESS, 0.0) is None
    assert plant.ahead(INTERVAL_US) is None
    assert plant.dropped["repeated"] == 3


def test_a_plant_that_runs_freely_takes_what_is_newer(autopilot: AutopilotEnd) -> None:
    plant = PlantEnd(system_id=1, frame_interval_us=INTERVAL_US, waits=False)
    call(autopilot, plant)
    first = offered(plant, frame_at(0))
    assert autopilot.receive(first, 0.0) == ReceivedFrame(frame_at(0))
    offered(plant, frame_at(INTERVAL_US))  # lost
    third = offered(plant, frame_at(2 * INTERVAL_US))
    assert plant.poll(10.0) > 10.0
    assert plant.take_outbox() == []
    assert autopilot.receive(third, 0.0) == ReceivedFrame(frame_at(2 * INTERVAL_US))
    assert autopilot.receive(first, 0.0) is None
    answers = [encode_actuators(Codec(1, dialect.AUTOPILOT_COMPONENT), command_at(n * INTERVAL_US)) for n in range(4)]
    assert plant.receive(answers[1], ADDRESS, 0.0) == command_at(INTERVAL_US)
    assert plant.receive(answers[0], ADDRESS, 0.0) is None
    assert plant.receive(answers[1], ADDRESS, 0.0) is None
    assert plant.receive(answers[3], ADDRESS, 0.0) is None
    assert plant.receive(answers[2], ADDRESS, 0.0) == command_at(2 * INTERVAL_US)
