from collections.abc import Collection, Mapping
from math import inf, nan

import pytest

from colibri.mavlink.parameters.store import (
    INT32_MAX,
    INT32_MIN,
    ParamError,
    Parameter,
    Parameters,
    ParamType,
    Prepared,
    Value,
    float32,
)

COUNT = Parameter(name="COUNT", kind=ParamType.INT, default=3, minimum=-5, maximum=9, description="Of things")
ANY = Parameter(name="ANY", kind=ParamType.INT, default=0, description="Anything")
SPEED = Parameter(name="SPEED", kind=ParamType.REAL, default=0.1, minimum=0.1, maximum=0.7, description="Of it")
TRACK = Parameter(name="TRACK", kind=ParamType.INT, default=0, description="Which", values=((0, "Line"), (2, "Circle")))
ID = Parameter(name="ID", kind=ParamType.INT, default=7, description="Its own", read_only=True)


@pytest.fixture
def parameters() -> Parameters:
    return Parameters([SPEED, COUNT, ID, TRACK, ANY])


def test_they_come_in_the_order_of_their_names(parameters: Parameters) -> None:
    assert [parameter.name for parameter in parameters] == ["ANY", "COUNT", "ID", "SPEED", "TRACK"]
    assert parameters.index("ID") == 2
    assert parameters.at(2) == ID
    assert parameters.at(-1) is None
    assert parameters.at(5) is None
    assert parameters.index("NONE") is None


@pytest.mark.parametrize(
    ("name", "value", "refusal"),
    [
        ("COUNT", -5, None),
        ("COUNT", 9, None),
        ("COUNT", 10, ParamError.VALUE_OUT_OF_RANGE),
        ("COUNT", -6, ParamError.VALUE_OUT_OF_RANGE),
        ("COUNT", 4.0, ParamError.TYPE_MISMATCH),
        ("ANY", INT32_MIN, None),
        ("ANY", INT32_MAX, None),
        ("ANY", INT32_MAX + 1, ParamError.VALUE_OUT_OF_RANGE),
        ("SPEED", 0.1, None),
        ("SPEED", 0.7, None),
        ("SPEED", 0.71, ParamError.VALUE_OUT_OF_RANGE),
        ("SPEED", nan, ParamError.VALUE_OUT_OF_RANGE),
        ("SPEED", inf, ParamError.VALUE_OUT_OF_RANGE),
        ("SPEED", 1e300, ParamError.VALUE_OUT_OF_RANGE),
        ("TRACK", 2, None),
        ("TRACK", 1, ParamError.VALUE_OUT_OF_RANGE),
        ("ID", 8, ParamError.READ_ONLY),
        ("ID", 7, None),
        ("NONE", 1, ParamError.DOES_NOT_EXIST),
    ],
)
def test_what_may_be_set(parameters: Parameters, name: str, value: Value, refusal: ParamError | None) -> None:
    before = parameters.values
    assert parameters.set(name, value) == refusal
    if refusal is None:
        assert parameters[name] == float32(value) if name == "SPEED" else value
    else:
        assert parameters.values == before
        assert parameters.revision == 0


def test_changes_are_counted(parameters: Parameters) -> None:
    for value in (4, 4, 5):
        parameters.set("COUNT", value)
    parameters.set("SPEED", 0.5)
    assert parameters.revision == 3
    assert parameters.take_made() is None


def test_a_prepared_value_is_returned_with_its_change(parameters: Parameters) -> None:
    parameters.prepare = lambda names, values: Prepared(values["COUNT"] if "COUNT" in names else None)
    assert parameters.set("COUNT", 4) is None
    assert parameters.set("ANY", 1) is None
    assert parameters.take_made() == 4
    assert parameters.set("ANY", 2) is None
    assert parameters.take_made() is None


def test_the_check_sees_all_values_and_can_refuse(parameters: Parameters) -> None:
    seen: list[tuple[list[str], Mapping[str, Value]]] = []

    def prepare(names: Collection[str], values: Mapping[str, Value]) -> Prepared | ParamError:
        seen.append((list(names), values))
        return ParamError.PERMISSION_DENIED if values["COUNT"] + values["ANY"] > 8 else Prepared()

    parameters.prepare = prepare
    assert parameters.set("COUNT", 5) is None
    assert parameters.set("ANY", 4) == ParamError.PERMISSION_DENIED
    assert parameters["ANY"] == 0
    assert parameters.set("ANY", 3) is None
    assert parameters.set("COUNT", 99) == ParamError.VALUE_OUT_OF_RANGE
    assert seen[1] == (["ANY"], {**parameters.values, "ANY": 4})
    assert len(seen) == 3


def test_proposed_changes_are_prepared_at_once(parameters: Parameters) -> None:
    """Of a batch that is refused, the halves are tried; a second value for a name waits for the first."""
    tried: list[Mapping[str, Value]] = []

    def prepare(names: Collection[str], values: Mapping[str, Value]) -> Prepared | ParamError:
        tried.append({name: values[name] for name in names})
        return ParamError.PERMISSION_DENIED if values["ANY"] == 13 else Prepared()

    parameters.prepare = prepare
    assert [parameters.propose(*each) for each in (("COUNT", 4), ("SPEED", 0.5), ("TRACK", 2))] == [True] * 3
    parameters.settle()
    assert (tried.pop(), len(parameters.settled)) == ({"COUNT": 4, "SPEED": 0.5, "TRACK": 2}, 3)
    parameters.settled.clear()
    changes = (("COUNT", 5), ("ANY", 13), ("TRACK", 0), ("COUNT", 6), ("COUNT", 99), ("ID", 7))
    assert [parameters.propose(*each) for each in changes] == [True] * 4 + [ParamError.VALUE_OUT_OF_RANGE, False]
    while parameters.proposed:
        parameters.settle()
    refused = [name for name, refusal in parameters.settled if refusal is not None]
    assert (refused, tried[-1]) == (["ANY"], {"COUNT": 6})
    assert [parameters[name] for name in ("COUNT", "ANY", "TRACK")] == [6, 0, 0]


def test_loading_and_resetting(parameters: Parameters) -> None:
    parameters.load({"COUNT": 6, "SPEED": 0.5})
    assert (parameters["COUNT"], parameters["SPEED"]) == (6, 0.5)
    parameters.reset()
    parameters.settle()
    assert (parameters["COUNT"], parameters["SPEED"]) == (3, float32(0.1))


@pytest.mark.parametrize(
    "change",
    [
        {"name": "lower"},
        {"name": "SEVENTEEN_LETTERS"},
        {"name": ""},
        {"name": "1ST"},
        {"default": 10},
        {"values": ((1, "One"),)},
    ],
)
def test_a_parameter_that_cannot_be(change: dict[str, object]) -> None:
    wanted = {"name": "COUNT", "kind": ParamType.INT, "default": 3, "maximum": 9, "description": "", **change}
    with pytest.raises(ValueError, match=r"name|default"):
        Parameter(**wanted)  # type: ignore[arg-type]


def test_two_of_one_name() -> None:
    with pytest.raises(ValueError, match="one name"):
        Parameters([COUNT, COUNT])
