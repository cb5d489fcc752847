"""The packed parameter file, read as ground stations read it."""

from struct import unpack
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavftp import MAVFTP

from colibri.mavlink.parameters.pack import BLOCK_BYTES, packed
from colibri.mavlink.parameters.store import INT32_MAX, INT32_MIN, Parameter, Parameters, ParamType


def unpacked(file: bytes | None) -> tuple[dict[str, Any], dict[str, Any] | None]:
    assert file is not None
    data = MAVFTP.ftp_param_decode(file)
    assert data is not None
    kinds = {int: 3, float: 4}
    for name, value, kind in data.params:
        assert kind == kinds[type(value)], name
    defaults = None if data.defaults is None else {name.decode(): value for name, value, _ in data.defaults}
    return {name.decode(): value for name, value, _ in data.params}, defaults


def parameters_of(names: list[str]) -> Parameters:
    parameters = Parameters(
        Parameter(name=name, kind=ParamType.INT, default=-i, description="")
        if i % 2
        else Parameter(name=name, kind=ParamType.REAL, default=i / 3.0, description="")
        for i, name in enumerate(names)
    )
    for parameter in list(parameters)[::3]:
        parameters.set(parameter.name, INT32_MIN if parameter.kind == ParamType.INT else 1.7)
    return parameters


NAMES = st.lists(st.from_regex("[A-C][A-C_]{0,15}", fullmatch=True), unique=True, min_size=1, max_size=120)


@given(NAMES)
def test_values_and_defaults_come_back(names: list[str]) -> None:
    parameters = parameters_of(names)
    assert unpacked(packed(parameters)) == (parameters.values, None)
    defaults = {parameter.name: parameter.default for parameter in parameters}
    assert unpacked(packed(parameters, "withdefaults=1")) == (parameters.values, defaults)


@pytest.mark.parametrize("value", [INT32_MIN, INT32_MAX, -8388607, -4194305, 2139095041, 2143289343, 0, -1])
def test_integers_are_packed_as_integers(value: int) -> None:
    parameters = Parameters([Parameter(name="X", kind=ParamType.INT, default=5, description="")])
    parameters.set("X", value)
    assert unpacked(packed(parameters, "withdefaults=1")) == ({"X": value}, {"X": 5})


@given(NAMES)
def test_no_value_lies_across_two_blocks(names: list[str]) -> None:
    file = packed(parameters_of(names), "withdefaults=1")
    assert file is not None
    at = 6
    while at < len(file):
        if file[at] == 0:
            at += 1
            continue
        values = 8 if file[at] & 0x10 else 4
        start = at + 2 + (file[at + 1] >> 4) + 1
        at = start + values
        assert start // BLOCK_BYTES == (at - 1) // BLOCK_BYTES


@pytest.mark.parametrize(
    ("query", "magic", "count"),
    [
        ("", 0x671B, 10),
        ("withdefaults=1", 0x671C, 10),
        ("withdefaults=0", 0x671B, 10),
        ("start=4", 0x671B, 6),
        ("start=4&count=3&withdefaults=1", 0x671C, 3),
        ("count=99", 0x671B, 10),
        ("colour=blue", 0x671B, 10),
    ],
)
def test_what_a_query_asks_for(query: str, magic: int, count: int) -> None:
    file = packed(parameters_of([f"P{i}" for i in range(10)]), query)
    assert file is not None
    assert unpack("<HHH", file[:6]) == (magic, count, 10)
    assert len(unpacked(file)[0]) == count


@pytest.mark.parametrize("query", ["start=10", "start=-1", "count=x", "start=", "count=999999", "start=²"])
def test_a_query_that_cannot_be(query: str) -> None:
    assert packed(parameters_of([f"P{i}" for i in range(10)]), query) is None
