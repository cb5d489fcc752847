from typing import Any

from colibri.mavlink.client.client import LOST_AFTER_US, Client, ConversationEnded, VehicleFound, VehicleLost
from colibri.mavlink.client.commands import Command
from colibri.mavlink.client.conversation import UNANSWERED, Repeat
from colibri.mavlink.client.parameters import ReadParameter
from colibri.mavlink.wire.dialect import Codec, Message, definition_of, mav
from colibri.mavlink.wire.signing import Signing

TARGET = (1, 1)
ARM: int = mav.MAV_CMD_COMPONENT_ARM_DISARM
PX4, ARDUPILOT = mav.MAV_AUTOPILOT_PX4, mav.MAV_AUTOPILOT_ARDUPILOTMEGA
READS = Codec(0, 0)


def beat(system: int = 1, autopilot: int = PX4, component: int = 1) -> bytes:
    fields = (mav.MAV_TYPE_QUADROTOR, autopilot, 0, 0, mav.MAV_STATE_ACTIVE, 3)
    return Codec(system, component).encode("HEARTBEAT", *fields)


def said(name: str, *fields: Any, system: int = 1) -> bytes:
    return Codec(system, 1).encode(name, *fields)


def ack(number: int, result: int = 0, to: tuple[int, int] = (255, 190), progress: int = 0) -> bytes:
    return said("COMMAND_ACK", number, result, progress, 0, *to)


def requested(target: tuple[int, int], name: str) -> Command:
    return Command(target, mav.MAV_CMD_REQUEST_MESSAGE, float(definition_of(name).id))


def sent(client: Client, now_us: int) -> list[Message]:
    messages = [message for datagram in client.poll(now_us) for message in READS.decode(datagram)]
    return [message for message in messages if message.name != "HEARTBEAT"]


def test_a_conversation_as_a_script_of_events() -> None:
    client = Client(255, 190)
    (heartbeat,) = READS.decode(client.poll(0)[0])
    assert (heartbeat.source, heartbeat.fields.type) == ((255, 190), mav.MAV_TYPE_GCS)
    client.receive(beat(), 100_000)
    (found,) = client.take_events()
    assert isinstance(found, VehicleFound)
    arming = client.begin(Command(found.vehicle.target, ARM, 1.0))
    (message,) = sent(client, 200_000)
    assert (message.fields.command, message.fields.confirmation, message.fields.param1) == (ARM, 0, 1.0)
    assert not sent(client, 699_999)
    (message,) = sent(client, 700_000)
    assert message.fields.confirmation == 1
    client.receive(ack(ARM, mav.MAV_RESULT_DENIED), 800_000)
    assert client.take_events() == [ConversationEnded(arming)]
    assert (arming.result, arming.accepted) == (mav.MAV_RESULT_DENIED, False)
    assert not sent(client, 5_000_000)
    (lost,) = client.take_events()
    assert lost == VehicleLost(client.vehicles[1])


def test_vehicles_are_found_lost_and_found_again() -> None:
    client = Client(255, 190)
    for system, autopilot in ((1, PX4), (7, ARDUPILOT)):
        client.receive(beat(system, autopilot), 0)
    assert [type(event) for event in client.take_events()] == [VehicleFound, VehicleFound]
    assert client.vehicle == client.vehicles[1]
    assert [vehicle.autopilot for vehicle in client.vehicles.values()] == [PX4, ARDUPILOT]
    client.receive(beat(7, ARDUPILOT), LOST_AFTER_US)
    client.poll(LOST_AFTER_US + 1)
    assert client.take_events() == [VehicleLost(client.vehicles[1])]
    assert [vehicle.lost for vehicle in client.vehicles.values()] == [True, False]
    client.receive(beat(1), 2 * LOST_AFTER_US)
    assert client.take_events() == [VehicleFound(client.vehicles[1])]


def test_a_vehicle_is_known_by_its_version() -> None:
    client, bits = Client(255, 190), mav.MAV_PROTOCOL_CAPABILITY_FTP
    client.receive(beat(), 0)
    question = client.begin(requested(TARGET, "AUTOPILOT_VERSION"))
    (message,) = sent(client, 0)
    assert message.fields.param1 == mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    none = (0,) * 8
    client.receive(said("AUTOPILOT_VERSION", bits, 0, 0, 0, 0, none, none, none, 0, 0, 0, b"name".ljust(18, b"\0")), 1)
    client.receive(ack(mav.MAV_CMD_REQUEST_MESSAGE), 1)
    client.receive(beat(), 2)
    assert question.accepted
    assert client.vehicles[1].capabilities == bits
    assert client.vehicles[1].uid2.startswith(b"name")


def test_other_components_and_vehicles_are_not_listened_to() -> None:
    client = Client(255, 190, only=1)
    assert not client.receive(beat(1, component=154), 0)
    assert not client.receive(beat(2), 0)
    assert not client.receive(b"nonsense", 0)
    assert not client.vehicles
    assert len(client.receive(beat(1) + said("STATUSTEXT", 6, "hello"), 0)) == 2
    assert sum(client.dropped.values()) == 1


def test_an_answer_to_somebody_else_is_none() -> None:
    client = Client(255, 190)
    arming = client.begin(Command(TARGET, ARM, 1.0))
    for to in ((254, 190), (255, 191)):
        client.receive(ack(ARM, to=to), 0)
    client.receive(Codec(2, 1).encode("COMMAND_ACK", ARM, 0), 0)
    assert arming.result is None
    client.receive(ack(ARM, to=(0, 0)), 0)
    assert arming.accepted


def test_commands_of_a_kind_take_turns_and_others_do_not() -> None:
    client = Client(255, 190)
    first, second = (client.begin(requested(TARGET, name)) for name in ("HOME_POSITION", "ODOMETRY"))
    client.begin(Command(TARGET, ARM, 1.0))
    client.begin(requested((2, 1), "ODOMETRY"))
    numbers = [(message.fields.target_system, message.fields.command) for message in sent(client, 0)]
    assert numbers == [(1, mav.MAV_CMD_REQUEST_MESSAGE), (1, ARM), (2, mav.MAV_CMD_REQUEST_MESSAGE)]
    client.receive(ack(mav.MAV_CMD_REQUEST_MESSAGE), 1)
    assert first.accepted
    assert second.result is None
    (message,) = sent(client, 2)
    assert message.fields.param1 == mav.MAVLINK_MSG_ID_ODOMETRY


def test_silence_ends_a_conversation_and_frees_its_lane() -> None:
    client, repeat = Client(255, 190), Repeat(100_000, 3)
    first, second = (client.begin(Command(TARGET, ARM, armed, repeat=repeat)) for armed in (1.0, 0.0))
    assert [len(sent(client, 100_000 * n)) for n in range(4)] == [1, 1, 1, 0]
    assert first.result == UNANSWERED
    assert client.take_events() == [ConversationEnded(first)]
    (message,) = sent(client, 300_001)
    assert message.fields.param1 == 0.0
    client.cancel(second)
    assert not sent(client, 900_000)
    assert not client.take_events()


def test_progress_extends_the_wait() -> None:
    client = Client(255, 190)
    calibration = client.begin(Command(TARGET, mav.MAV_CMD_PREFLIGHT_CALIBRATION, 1.0, repeat=Repeat(500_000, 2)))
    for second in range(10):
        assert len(sent(client, 1_000_000 * second)) == (second == 0)
        client.receive(ack(241, mav.MAV_RESULT_IN_PROGRESS, progress=10 * second), 1_000_000 * second)
    assert calibration.progress == 90
    client.receive(ack(241), 9_500_000)
    assert calibration.accepted


def test_signed_traffic() -> None:
    def signing(key: bytes) -> Signing:
        return Signing(key * 32, lambda: 10**9)

    client, vehicle, stranger = Client(255, 190), Codec(1, 1), Codec(1, 1)
    client.sign_with(signing(b"a"))
    judge, foreign = signing(b"a"), signing(b"b")
    vehicle.seal = lambda frame: judge.sign(frame, 1)
    stranger.seal = lambda frame: foreign.sign(frame, 2)
    text = ("STATUSTEXT", 6, "hello")
    assert not client.receive(said(*text), 0)
    assert not client.receive(stranger.encode(*text), 0)
    assert client.receive(vehicle.encode(*text), 0)
    assert client.dropped == {"unsigned": 1, "bad signature": 1}
    (message,) = READS.decode(client.poll(0)[0])
    assert judge.refusal(message.name, message.frame) is None


def test_a_parameter_of_another_name_is_no_answer() -> None:
    client = Client(255, 190)
    reading = client.begin(ReadParameter(TARGET, "A"))
    client.receive(said("PARAM_VALUE", "B", 1.0, mav.MAV_PARAM_TYPE_REAL32, 2, 1), 0)
    assert reading.result is None
    client.receive(said("PARAM_VALUE", "A", 2.0, mav.MAV_PARAM_TYPE_REAL32, 2, 0), 0)
    assert reading.held is not None
    assert reading.held.value == 2.0
