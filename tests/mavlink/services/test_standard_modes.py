"""Standard modes: the list that ground stations show, and setting one of it."""

import pytest
from hypothesis import given

from colibri.mavlink.node.service import Send
from colibri.mavlink.services.command import FAILED, ReceivedCommand
from colibri.mavlink.services.standard_modes import ModeInfo, StandardModes
from colibri.mavlink.wire.dialect import Refusal
from tests.support.messages import FLOATS, GROUND, NAN, on_the_wire

MODES = (
    ModeInfo("Position", 3 << 16, standard_mode=1),
    ModeInfo("Stabilized", 7 << 16, advanced=True),
    ModeInfo("Recovery with a name that is too long for its field", 9, standard_mode=5, selectable=False),
)


class Vehicle:
    def __init__(self) -> None:
        self.flown: list[int] = []

    def __call__(self, custom_mode: int, command: ReceivedCommand) -> Refusal | None:
        assert command.peer == GROUND
        self.flown.append(custom_mode)
        return None


def command(p1: float = 0.0, p2: float = 0.0) -> ReceivedCommand:
    return ReceivedCommand(0, p1, p2, 0.0, 0.0, 0.0, 0.0, 0.0, None, GROUND, 0)


def asked(p2: float) -> list[Send]:
    answer = StandardModes(MODES, Vehicle()).available_modes(command(435.0, p2))
    assert isinstance(answer, list)
    return answer


@pytest.mark.parametrize("all_modes", [0.0, NAN])
def test_all_modes_at_once(all_modes: float) -> None:
    received = [message.fields for message in on_the_wire(asked(all_modes))]
    assert [(fields.number_modes, fields.mode_index) for fields in received] == [(3, 1), (3, 2), (3, 3)]
    assert [fields.custom_mode for fields in received] == [mode.custom_mode for mode in MODES]
    assert [fields.standard_mode for fields in received] == [1, 0, 5]
    assert [fields.properties for fields in received] == [0, 1, 2]
    assert [fields.mode_name for fields in received] == ["Position", "Stabilized", MODES[2].name[:34]]


def test_one_mode_by_its_index() -> None:
    (received,) = on_the_wire(asked(2.0))
    assert received.fields.mode_name == "Stabilized"


@given(FLOATS)
def test_an_index_that_is_none_is_denied(index: float) -> None:
    answer = StandardModes(MODES, Vehicle()).available_modes(command(435.0, index))
    named = isinstance(answer, Refusal) and f"index {index:g}" in answer.reason
    assert named or index in (0.0, 1.0, 2.0, 3.0) or index != index


def test_a_standard_mode_is_flown() -> None:
    vehicle = Vehicle()
    (handler,) = StandardModes(MODES, vehicle).handlers().values()
    assert callable(handler)
    assert handler(command(1.0)) is None
    assert vehicle.flown == [3 << 16]


@pytest.mark.parametrize("p1", [0.0, 2.0, 5.0, 1.5, -1.0, NAN, float("inf")])
def test_a_mode_that_does_not_exist_or_may_not_be_chosen_fails(p1: float) -> None:
    vehicle = Vehicle()
    (handler,) = StandardModes(MODES, vehicle).handlers().values()
    assert callable(handler)
    refusal = handler(command(p1))
    assert refusal is not None
    assert refusal.result == FAILED
    assert vehicle.flown == []
