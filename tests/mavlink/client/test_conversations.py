"""Every conversation, with the services of this vehicle over bad links, and with answers of foreign vehicles."""

from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.mavlink.client.client import Client
from colibri.mavlink.client.commands import Command, CommandInt
from colibri.mavlink.client.conversation import OK, UNANSWERED, Conversation, Repeat
from colibri.mavlink.client.parameters import DIFFERS, ListParameters, ReadParameter, SetParameter
from colibri.mavlink.client.plans import Download, Upload
from colibri.mavlink.files.log_download import Logs
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.mission.items import FENCE, MISSION, PLAN_TYPES
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.parameters.service import ParameterService
from colibri.mavlink.parameters.store import INT32_MAX, INT32_MIN, ParamError, Parameter, Parameters, ParamType
from colibri.mavlink.services.command import CommandService
from colibri.mavlink.services.command import ReceivedCommand as Received
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.wire.dialect import Bits, Codec, mav
from tests.support.log_conversations import DownloadLog, ListLogs
from tests.support.mission_ends import Ground, bits, some_item
from tests.support.unruly_link import MINUTE_US, TARGET, Link, Vehicle

BAD_LINKS = {"seed": st.integers(0, 10**6), "loss": st.floats(0.0, 0.3), "unruly": st.floats(0.0, 1.0)}
ITEMS = [some_item(number) for number in range(12)]
PARAMETERS = (
    *(
        Parameter(name=f"MANY_{number}", kind=ParamType.REAL, default=0.5 * number, description="")
        for number in range(60)
    ),
    Parameter(name="INTEGER", kind=ParamType.INT, default=0, description=""),
    Parameter(name="LIMITED", kind=ParamType.INT, default=1, minimum=0, maximum=2, description=""),
    Parameter(name="FIXED", kind=ParamType.REAL, default=1.0, description="", read_only=True),
)
LOG = Random(1).randbytes(12_001)
PATIENTLY = Repeat(500_000, 60)
few = settings(max_examples=10)


class TryingVehicle(Vehicle):
    """A vehicle that tries proposed parameters once a step, as in flight."""

    def __init__(self, parameters: Parameters, *services: Any) -> None:
        super().__init__(*services)
        self._parameters = parameters

    def poll(self, now_us: int) -> list[tuple[int | None, bytes]]:
        if self._parameters.proposed:
            self._parameters.settle()
        return super().poll(now_us)


class Rig:
    def __init__(self, seed: int = 0, loss: float = 0.0, unruly: float = 0.0, rules: Rules | None = None) -> None:
        self.obeyed: list[Received] = []
        numbers = (mav.MAV_CMD_COMPONENT_ARM_DISARM, mav.MAV_CMD_DO_REPOSITION, mav.MAV_CMD_PREFLIGHT_CALIBRATION)
        self.commands = CommandService(dict.fromkeys(numbers, self.obeyed.append), StatusText())
        self.parameters = Parameters(PARAMETERS)
        self.ground = Ground(rules) if rules else Ground()
        memory = MemoryFiles()
        memory.make_folder(("logs",))
        for name, data in (("0.ulg", LOG), ("1.ulg", b"")):
            memory.create(("logs", name))
            memory.write(("logs", name), 0, data)
        held = ParameterService(self.parameters, StatusText())
        services = (self.commands, held, self.ground.service, Logs(memory, ("logs",)))
        self.client = Client(255, 190)
        self.link = Link(TryingVehicle(self.parameters, *services), [self.client], seed, loss=loss, unruly=unruly)

    def ended(self, conversation: Conversation) -> int | None:
        self.client.begin(conversation)
        self.link.run(lambda: conversation.result is not None, 10 * MINUTE_US)
        self.link.run(lambda: False, 100_000)  # until no copy of an answer is under way
        return conversation.result


@few
@given(**BAD_LINKS)
def test_commands_over_bad_links(seed: int, loss: float, unruly: float) -> None:
    rig = Rig(seed, loss, unruly)
    assert rig.ended(Command(TARGET, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 2.0, repeat=PATIENTLY)) == OK
    assert {(command.p1, command.p2) for command in rig.obeyed} == {(1.0, 2.0)}
    rig.obeyed.clear()
    place = {"frame": mav.MAV_FRAME_GLOBAL, "x": 470000000, "y": 80000000, "z": 5.0}
    assert rig.ended(CommandInt(TARGET, mav.MAV_CMD_DO_REPOSITION, -1.0, **place, repeat=PATIENTLY)) == OK
    assert {(command.x, command.y, command.z) for command in rig.obeyed} == {(47.0, 8.0, 5.0)}
    assert rig.ended(Command(TARGET, mav.MAV_CMD_DO_GRIPPER, repeat=PATIENTLY)) == mav.MAV_RESULT_UNSUPPORTED


@few
@given(**BAD_LINKS, value=st.integers(INT32_MIN, INT32_MAX))
def test_parameters_over_bad_links(seed: int, loss: float, unruly: float, value: int) -> None:
    rig = Rig(seed, loss, unruly)
    for kind in (None, mav.MAV_PARAM_TYPE_INT32):
        assert rig.ended(SetParameter(TARGET, "INTEGER", value, kind=kind, repeat=PATIENTLY)) == OK
    assert rig.parameters["INTEGER"] == value
    reading = ReadParameter(TARGET, "INTEGER", repeat=PATIENTLY)
    assert rig.ended(reading) == OK
    assert reading.held is not None
    assert reading.held.value == value
    everything = ListParameters(TARGET, repeat=PATIENTLY)
    assert rig.ended(everything) == OK
    assert {name: held.value for name, held in everything.held.items()} == dict(rig.parameters.values)


@few
@given(**BAD_LINKS, plan=st.sampled_from(PLAN_TYPES))
def test_plans_over_bad_links(seed: int, loss: float, unruly: float, plan: int) -> None:
    rig = Rig(seed, loss, unruly)
    for items in (ITEMS, ITEMS[3:9], ()):
        upload = Upload(TARGET, items, plan, repeat=PATIENTLY)
        assert rig.ended(upload) == OK
        assert bits(rig.ground.service.plans[plan].items) == bits(items)
        download = Download(TARGET, plan, repeat=PATIENTLY)
        assert rig.ended(download) == OK
        assert bits(download.items) == bits(items)
        assert download.opaque_id == upload.opaque_id == rig.ground.service.plans[plan].id


@few
@given(**BAD_LINKS)
def test_logs_over_bad_links(seed: int, loss: float, unruly: float) -> None:
    rig = Rig(seed, loss, unruly)
    logs = ListLogs(TARGET)
    assert rig.ended(logs) == OK
    assert logs.sizes == {0: len(LOG), 1: 0}
    for number, data in enumerate((LOG, b"")):
        download = DownloadLog(TARGET, number, len(data))
        assert rig.ended(download) == OK
        assert download.data == data


def test_copies_of_answers_do_not_breed_requests() -> None:
    rig = Rig(1, unruly=1.0)
    rig.client.begin(upload := Upload(TARGET, ITEMS))
    assert rig.link.run(lambda: upload.result is not None)
    assert rig.link.datagrams < 8 * len(ITEMS)


def test_a_refused_plan_names_the_item() -> None:
    no_place: int = mav.MAV_MISSION_INVALID_PARAM5_X
    rules = Rules(lambda item: no_place if item.x == ITEMS[7].x else OK, lambda _: (OK, 0))
    rig = Rig(rules=rules)
    upload = Upload(TARGET, ITEMS, FENCE)
    assert (rig.ended(upload), upload.seq) == (no_place, 7)
    assert rig.ended(Upload(TARGET, ITEMS[:3], FENCE)) == OK


@pytest.mark.parametrize(
    ("name", "value", "result"),
    [
        ("NOWHERE", 1.0, ParamError.DOES_NOT_EXIST),
        ("LIMITED", 9, ParamError.VALUE_OUT_OF_RANGE),
        ("INTEGER", 2**31, ParamError.VALUE_OUT_OF_RANGE),
        ("FIXED", 2.0, ParamError.READ_ONLY),
    ],
)
def test_a_refused_parameter(name: str, value: float, result: int) -> None:
    assert Rig().ended(SetParameter(TARGET, name, value)) == result


@pytest.mark.parametrize(
    "conversation",
    [Command(TARGET, 400), ReadParameter(TARGET, "A"), ListParameters(TARGET), Upload(TARGET, ITEMS), Download(TARGET)],
)
def test_nobody_answers(conversation: Conversation) -> None:
    client = Client(255, 190)
    client.begin(conversation)
    for now_us in range(0, MINUTE_US, 100_000):
        client.poll(now_us)
    assert conversation.result == UNANSWERED


# Foreign vehicles.


def answered(conversation: Conversation, *answers: tuple[Any, ...]) -> list[str]:
    """Hand a conversation the answers of a foreign vehicle, one after each request; return what it has sent."""
    client, vehicle, names = Client(255, 190, heartbeat_every_us=None), Codec(*TARGET), list[str]()
    client.begin(conversation)
    for number, (name, *fields) in enumerate(answers):
        for frame in client.poll(10_000_000 * number):
            names += [message.name for message in vehicle.decode(frame)]
        client.receive(vehicle.encode(name, *fields), 10_000_000 * number)
    return names


def test_integers_that_travel_as_numbers() -> None:
    int8 = mav.MAV_PARAM_TYPE_INT8
    change = SetParameter(TARGET, "GUID_OPTIONS", 9, by_bits=False)
    value = ("PARAM_VALUE", "GUID_OPTIONS")
    names = answered(change, (*value, 8.0, int8, 900, 7), (*value, 9.0, int8, 900, 65535))
    assert names == ["PARAM_REQUEST_READ", "PARAM_SET"]
    assert change.accepted
    assert change.held == (9, int8)


def test_a_vehicle_without_param_error_refuses_by_its_value() -> None:
    change = SetParameter(TARGET, "A", 5, kind=mav.MAV_PARAM_TYPE_INT32)
    answered(change, *[("PARAM_VALUE", "A", Bits(4), mav.MAV_PARAM_TYPE_INT32, 9, 1)] * 3)
    assert change.result == DIFFERS


def test_a_parameter_of_another_type_is_refused() -> None:
    change = SetParameter(TARGET, "A", 5, kind=mav.MAV_PARAM_TYPE_INT32)
    answered(change, ("PARAM_VALUE", "A", 5.0, mav.MAV_PARAM_TYPE_REAL32, 9, 1))
    assert change.result == ParamError.TYPE_MISMATCH


def test_an_old_acknowledgement_does_not_end_an_upload() -> None:
    upload, to = Upload(TARGET, ITEMS[:1]), (255, 190)
    done = ("MISSION_ACK", *to, OK, MISSION)
    names = answered(upload, done, ("MISSION_REQUEST", *to, 0, MISSION), ("MISSION_REQUEST", *to, 0, MISSION), done)
    assert names == ["MISSION_COUNT", "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM_INT"]
    assert upload.accepted


def test_a_plan_that_is_not_to_be_had() -> None:
    download = Download(TARGET, FENCE)
    answered(download, ("MISSION_ACK", 255, 190, mav.MAV_MISSION_UNSUPPORTED, FENCE))
    assert download.result == mav.MAV_MISSION_UNSUPPORTED
