"""What frames and answers bring along: faults, changes of the world, the battery, delays."""

from math import inf, nan

from colibri.mavlink.hil.faults import MOTOR, OFF, WRONG, Fault, encode_fault
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.plant_status import NOTHING, FaultResult, PlantBattery, PlantStatus, ReceivedFrame
from colibri.mavlink.hil.state import encode_actuators
from colibri.mavlink.hil.world_changes import PayloadChange, WindChange, encode_change
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec
from tests.support.lockstep_ends import ADDRESS, INTERVAL_US, STRANGER, call, command_at, frame_at, offered

BATTERY = PlantBattery(15.5, 12.25, 0.5, 0.75)
WEAK = Fault(MOTOR, WRONG, 1, (0.5, 0.0, 0.0, 0.0))


def test_a_fault_comes_with_the_answer_and_once(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    autopilot.receive(offered(plant, frame_at(0)), 0.0)
    autopilot.answer(command_at(0), [WEAK])
    (answer,) = autopilot.take_outbox()
    assert plant.receive(answer, ADDRESS, 0.0) == command_at(0)
    assert plant.take_faults() == [WEAK]
    assert plant.receive(answer, ADDRESS, 0.0) is None
    assert plant.take_faults() == []


def test_a_fault_without_an_answer_is_dropped(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    offered(plant, frame_at(0))
    codec = Codec(1, dialect.AUTOPILOT_COMPONENT)
    plant.receive(encode_fault(codec, WEAK, (1, dialect.PLANT_COMPONENT)), ADDRESS, 0.0)
    assert plant.take_faults() == []
    assert plant.dropped["repeated"] == 1


def test_the_world_changes_with_the_answer_where_it_can_be_so(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    codec, to_plant = Codec(1, dialect.AUTOPILOT_COMPONENT), (1, dialect.PLANT_COMPONENT)
    changes = (WindChange(5.0, 270.0), PayloadChange(0.5))
    impossible = (WindChange(-1.0, 0.0), WindChange(1.0, 361.0), WindChange(nan, 0.0), PayloadChange(inf))
    call(autopilot, plant)
    offered(plant, frame_at(0))
    datagram = b"".join(encode_change(codec, change, to_plant) for change in (*changes, *impossible))
    assert plant.receive(datagram, ADDRESS, 0.0) is None
    assert plant.take_faults() == []
    plant.receive(encode_actuators(codec, command_at(0)) + datagram, ADDRESS, 0.0)
    assert plant.take_faults() == list(changes)
    assert plant.dropped["invalid"] == len(impossible)


def test_a_fault_result_comes_once_with_the_next_frame(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    results = (FaultResult(MOTOR, OFF, 0), FaultResult(MOTOR, WRONG, 2))
    datagram = offered(plant, frame_at(0), PlantStatus(None, results))
    assert autopilot.receive(datagram, 0.0) == ReceivedFrame(frame_at(0), PlantStatus(None, results))
    autopilot.receive(datagram, 0.0)
    assert autopilot.repeated == 1
    autopilot.answer(command_at(0))
    (answer,) = autopilot.take_outbox()
    plant.receive(answer, ADDRESS, 0.0)
    assert autopilot.receive(offered(plant, frame_at(INTERVAL_US)), 0.0) == ReceivedFrame(
        frame_at(INTERVAL_US), NOTHING
    )


def test_the_battery_is_told_twice_a_second_and_to_who_is_new(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    told = []
    for time_us in range(0, 11 * INTERVAL_US, INTERVAL_US):
        received = autopilot.receive(offered(plant, frame_at(time_us), PlantStatus(BATTERY)), 0.0)
        told.append(received and received.plant_status.battery)
        autopilot.answer(command_at(time_us))
        plant.receive(autopilot.take_outbox()[0], ADDRESS, 0.0)
    assert [number for number, battery in enumerate(told) if battery == BATTERY] == [0, 5, 10]
    offered(plant, frame_at(11 * INTERVAL_US), PlantStatus(BATTERY))
    again = AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=1.0)
    again.poll(1.0)
    plant.receive(again.take_outbox()[0], STRANGER, 1.0)
    frames = [again.receive(outgoing.datagram, 1.0) for outgoing in plant.take_outbox()]
    assert ReceivedFrame(frame_at(11 * INTERVAL_US), PlantStatus(BATTERY)) in frames


def test_a_delay_is_sent_with_its_frame(plant: PlantEnd, autopilot: AutopilotEnd) -> None:
    call(autopilot, plant)
    without, late = offered(plant, frame_at(0)), offered(plant, frame_at(0), PlantStatus(delay_us=16_123))
    assert len(late) > len(without)
    assert autopilot.receive(late, 0.0) == ReceivedFrame(frame_at(0), PlantStatus(delay_us=16_123))
