"""The parameter microservice, over the bytes of its messages."""

from struct import pack, unpack
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.parameters.service import ParameterService
from colibri.mavlink.parameters.store import INT32_MAX, INT32_MIN, ParamError, Parameter, Parameters, ParamType
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Bits, Codec, Message, mav, param_bits

VEHICLE = Codec(1, AUTOPILOT_COMPONENT)
STATION = Codec(245, 190)
ME, OTHER = Peer(3, 245, 190), Peer(4, 255, 230)
FRAME_US = 4_000
INT32, REAL32 = int(ParamType.INT), int(ParamType.REAL)


def parameters_of(count: int = 0) -> Parameters:
    many = [Parameter(name=f"MANY_{i:011}", kind=ParamType.INT, default=i, description="") for i in range(count)]
    limited = Parameter(name="LIMITED", kind=ParamType.INT, default=1, minimum=0, maximum=2, description="")
    return Parameters(
        [
            *many,
            Parameter(name="INTEGER", kind=ParamType.INT, default=0, description=""),
            Parameter(name="REAL", kind=ParamType.REAL, default=0.5, minimum=-1e9, maximum=1e9, description=""),
            limited,
            Parameter(name="FIXED", kind=ParamType.REAL, default=1.0, description="", read_only=True),
        ]
    )


class Talk:
    def __init__(self, parameters: Parameters) -> None:
        self.parameters, self.service = parameters, ParameterService(parameters, StatusText())
        self.now_us = 0

    def ask(self, name: str, *fields: Any, peer: Peer = ME) -> list[Message]:
        (message,) = STATION.decode(STATION.encode(name, 1, 1, *fields))
        sends = list(self.service.receive(message, peer, self.now_us))
        if self.parameters.proposed:
            self.parameters.settle()
            sends += self.service.poll(self.now_us)
        assert all(send.channel in (None, peer.channel) for send in sends)
        return heard(sends)

    def set(self, name: str, value: Any, kind: int) -> list[Message]:
        return self.ask("PARAM_SET", name.encode(), value, kind)

    def read(self, name: str = "", index: int = -1) -> list[Message]:
        return self.ask("PARAM_REQUEST_READ", name.encode(), index)

    def poll(self) -> list[Send]:
        self.now_us += FRAME_US
        return list(self.service.poll(self.now_us))


def heard(sends: list[Send]) -> list[Message]:
    return [message for send in sends for message in VEHICLE.decode(VEHICLE.encode(send.name, *send.fields))]


def as_int(message: Message) -> int:
    (value,) = unpack("<i", pack("<I", param_bits(message)))
    return int(value)


def bits_of_int(value: int) -> Bits:
    (bits,) = unpack("<I", pack("<i", value))
    return Bits(bits)


@given(st.integers(INT32_MIN, INT32_MAX) | st.integers(-8388607, -4194305) | st.integers(2139095041, 2143289343))
@example(INT32_MIN)
@example(INT32_MAX)
def test_every_integer_survives_the_round_trip(value: int) -> None:
    parameters = parameters_of()
    talk = Talk(parameters)
    (answer,) = talk.set("INTEGER", bits_of_int(value), INT32)
    assert (answer.name, answer.fields.param_id, answer.fields.param_type) == ("PARAM_VALUE", "INTEGER", INT32)
    assert parameters["INTEGER"] == value
    assert as_int(answer) == value
    (read,) = talk.read("INTEGER")
    assert as_int(read) == value


@given(st.floats(-1e9, 1e9, width=32))
def test_every_real_survives_the_round_trip(value: float) -> None:
    talk = Talk(parameters_of())
    (answer,) = talk.set("REAL", value, REAL32)
    assert answer.fields.param_value == value
    (read,) = talk.read("REAL")
    assert read.fields.param_value == value


def test_a_set_is_told_to_everybody() -> None:
    talk = Talk(parameters_of())
    (message,) = STATION.decode(STATION.encode("PARAM_SET", 1, 1, b"REAL", 2.5, REAL32))
    assert not list(talk.service.receive(message, ME, 0))
    talk.parameters.settle()
    (send,) = talk.service.poll(0)
    assert send.channel is None


@pytest.mark.parametrize(
    ("name", "value", "kind", "refusal"),
    [
        ("REAL", float("nan"), REAL32, ParamError.VALUE_OUT_OF_RANGE),
        ("REAL", float("inf"), REAL32, ParamError.VALUE_OUT_OF_RANGE),
        ("REAL", 2e9, REAL32, ParamError.VALUE_OUT_OF_RANGE),
        ("REAL", bits_of_int(1), INT32, ParamError.TYPE_MISMATCH),
        ("LIMITED", bits_of_int(3), INT32, ParamError.VALUE_OUT_OF_RANGE),
        ("LIMITED", 1.5, REAL32, ParamError.TYPE_MISMATCH),
        ("LIMITED", float("nan"), REAL32, ParamError.TYPE_MISMATCH),
        ("LIMITED", 3.0, REAL32, ParamError.VALUE_OUT_OF_RANGE),
        ("INTEGER", 16777216.0, REAL32, ParamError.TYPE_MISMATCH),
        ("INTEGER", 1.0, mav.MAV_PARAM_TYPE_UINT8, ParamError.TYPE_UNSUPPORTED),
        ("INTEGER", 1.0, 0, ParamError.TYPE_UNSUPPORTED),
        ("INTEGER", 1.0, 255, ParamError.TYPE_UNSUPPORTED),
        ("FIXED", 2.0, REAL32, ParamError.READ_ONLY),
    ],
)
def test_who_is_refused_hears_why_and_what_holds(name: str, value: Any, kind: int, refusal: ParamError) -> None:
    parameters = parameters_of()
    held = parameters[name]
    error, value_message, told, *_ = Talk(parameters).set(name, value, kind)
    index = parameters.index(name)
    assert (error.name, error.fields.param_id, error.fields.error) == ("PARAM_ERROR", name, refusal)
    assert (error.fields.target_system, error.fields.target_component) == (ME.system, ME.component)
    assert (value_message.name, value_message.fields.param_index) == ("PARAM_VALUE", index)
    assert parameters[name] == held
    reason = (
        {"LIMITED": "3 is not within 0 to 2"}.get(name, "")
        if refusal is ParamError.VALUE_OUT_OF_RANGE
        else refusal.name.split("_")[0].lower()
    )
    assert told.fields.text.startswith(f"{name} not changed: {reason}")


def test_an_integer_sent_as_float_is_accepted_if_exact() -> None:
    """As MAVProxy sets one after it has read the packed file, and DroneKit always."""
    parameters = parameters_of()
    for value in (-7.0, 16777215.0, 0.0):
        (answer,) = Talk(parameters).set("INTEGER", value, REAL32)
        assert (answer.fields.param_type, as_int(answer)) == (INT32, int(value))
        assert parameters["INTEGER"] == value


def test_setting_what_does_not_exist() -> None:
    error, told = Talk(parameters_of()).set("NOTHING", 1.0, REAL32)
    assert (error.name, error.fields.param_id) == ("PARAM_ERROR", "NOTHING")
    assert told.fields.text == "NOTHING not changed: there is no such parameter"
    assert (error.fields.error, error.fields.param_index) == (ParamError.DOES_NOT_EXIST, -1)


def test_reading_by_id_and_by_index() -> None:
    parameters = parameters_of(3)
    talk = Talk(parameters)
    for index, parameter in enumerate(parameters):
        (by_id,), (by_index,) = talk.read(parameter.name), talk.read("ignored", index)
        assert by_id.frame[10:-2] == by_index.frame[10:-2]
        fields = by_id.fields
        assert (fields.param_id, fields.param_index, fields.param_count) == (parameter.name, index, len(parameters))


@pytest.mark.parametrize(("name", "index"), [("NOTHING", -1), ("", 7), ("REAL", -2), ("", -32768), ("", 32767)])
def test_reading_what_does_not_exist(name: str, index: int) -> None:
    (error,) = Talk(parameters_of(3)).read(name, index)
    assert (error.name, error.fields.error) == ("PARAM_ERROR", ParamError.DOES_NOT_EXIST)
    assert (error.fields.param_id, error.fields.param_index) == (name, index)


def listed(talk: Talk, channel: int, seconds: float) -> list[int]:
    indices = []
    for _ in range(round(seconds * 1e6 / FRAME_US)):
        sends = [send for send in talk.poll() if send.channel == channel]
        assert len(sends) <= 3, "a list must not fill the link"
        indices += [message.fields.param_index for message in heard(sends)]
    return indices


def test_150_parameters_are_listed_in_well_under_a_second() -> None:
    talk = Talk(parameters_of(146))
    assert talk.ask("PARAM_REQUEST_LIST") == []
    assert listed(talk, ME.channel, 0.32) == list(range(150))
    assert talk.poll() == []


def test_each_station_gets_its_list() -> None:
    talk = Talk(parameters_of(20))
    got: dict[int | None, list[int]] = {ME.channel: [], OTHER.channel: []}
    talk.ask("PARAM_REQUEST_LIST")
    for frame in range(40):
        if frame == 5:
            talk.ask("PARAM_REQUEST_LIST", peer=OTHER)
        for send in talk.poll():
            got[send.channel] += [message.fields.param_index for message in heard([send])]
    assert got == {ME.channel: list(range(24)), OTHER.channel: list(range(24))}


def test_asking_again_on_the_way_gives_the_whole_list_once_more() -> None:
    talk = Talk(parameters_of(20))
    talk.ask("PARAM_REQUEST_LIST")
    before = listed(talk, ME.channel, 0.02)
    talk.ask("PARAM_REQUEST_LIST")
    after = listed(talk, ME.channel, 0.2)
    assert before == list(range(10))
    assert after == [*range(10, 24), *range(10)]


def test_a_list_goes_on_when_simulated_time_begins_anew() -> None:
    talk = Talk(parameters_of(20))
    talk.now_us = 10_000_000
    talk.ask("PARAM_REQUEST_LIST")
    talk.now_us = 0
    assert len(listed(talk, ME.channel, 0.1)) == 24


@given(
    st.sampled_from(["PARAM_SET", "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST"]),
    st.binary(max_size=16),
    st.integers(0, 2**32 - 1),
    st.integers(0, 255),
    st.integers(-32768, 32767),
    st.integers(-(2**63), 2**63 - 1),
)
def test_nothing_raises(name: str, param_id: bytes, bits: int, kind: int, index: int, now_us: int) -> None:
    fields = {"PARAM_SET": (param_id, Bits(bits), kind), "PARAM_REQUEST_READ": (param_id, index)}.get(name, ())
    service = ParameterService(parameters_of(), StatusText())
    (message,) = STATION.decode(STATION.encode(name, 1, 1, *fields))
    sends = [*service.receive(message, ME, now_us), *service.poll(now_us + 10_000)]
    assert len(heard(sends)) == len(sends)
