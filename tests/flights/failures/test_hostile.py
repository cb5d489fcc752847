"""Any messages in any mode: a vehicle that nothing makes raise, nor turn a rotor while disarmed, nor fly nonsense.

The long version is `python -m tools.fuzz`.
"""

import random
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from colibri.autopilot.commander.rules.modes import State
from tools.fuzz.ground import ground_campaign
from tools.fuzz.messages import SOURCES
from tools.fuzz.sensible import COMMANDS
from tools.fuzz.vehicle import SITUATIONS, Target

FLOATS = st.floats(width=32) | st.sampled_from([0.0, 1.0, -1.0, 21196.0])
INT32 = st.integers(-(2**31), 2**31 - 1)
PLACES = st.integers(0, 2)
TARGETS = st.sampled_from([0, 1, 1, 1, 2])


class UnderFire(RuleBasedStateMachine):
    """A vehicle; its invariants are looked at in every frame that it flies."""

    @initialize()
    def begin(self) -> None:
        self.target = Target(random.Random(0))

    @rule(state=st.sampled_from(SITUATIONS))
    def another_situation(self, state: State) -> None:
        self.target.prepare(state)

    @rule(chance=st.randoms(use_true_random=False), count=st.integers(1, 20), place=PLACES)
    def any_messages(self, chance: random.Random, count: int, place: int) -> None:
        self.target.messages.chance = chance
        for _ in range(count):
            self.target.shoot(self.target.messages.any(), place)
        self.target.step()

    @rule(
        number=st.sampled_from(COMMANDS),
        to=st.tuples(TARGETS, TARGETS),
        params=st.lists(FLOATS, min_size=7, max_size=7),
        source=st.sampled_from(SOURCES),
        place=PLACES,
    )
    def command_long(
        self, number: int, to: tuple[int, int], params: list[float], source: tuple[int, int], place: int
    ) -> None:
        named = {f"param{position + 1}": value for position, value in enumerate(params)}
        self._command("COMMAND_LONG", _addressed(to, {"command": number, "confirmation": 0, **named}), source, place)

    @rule(
        number=st.sampled_from(COMMANDS),
        to=st.tuples(TARGETS, TARGETS),
        frame=st.sampled_from([0, 2, 3, 5, 6, 8, 255]),
        params=st.lists(FLOATS, min_size=4, max_size=4),
        xy=st.tuples(INT32, INT32) | st.just((473977420, 85455940)),
        z=FLOATS,
        place=PLACES,
    )
    def command_int(
        self,
        number: int,
        to: tuple[int, int],
        frame: int,
        params: list[float],
        xy: tuple[int, int],
        z: float,
        place: int,
    ) -> None:
        named = {f"param{position + 1}": value for position, value in enumerate(params)}
        fields = {"frame": frame, "command": number, "current": 0, "autocontinue": 0, **named}
        self._command("COMMAND_INT", _addressed(to, {**fields, "x": xy[0], "y": xy[1], "z": z}), SOURCES[0], place)

    def _command(self, name: str, fields: dict[str, Any], source: tuple[int, int], place: int) -> None:
        self.target.shoot(self.target.messages.sent(name, source, fields), place)
        self.target.step()

    @rule(frames=st.integers(1, 40))
    def fly_on(self, frames: int) -> None:
        for _ in range(frames):
            self.target.step()


def _addressed(to: tuple[int, int], fields: dict[str, Any]) -> dict[str, Any]:
    return {"target_system": to[0], "target_component": to[1], **fields}


UnderFire.TestCase.settings = settings(max_examples=6, stateful_step_count=18)
TestUnderFire = UnderFire.TestCase


@pytest.mark.long
def test_messages_by_the_thousand_in_every_mode() -> None:
    outcome = ground_campaign(10_000, seed=1)
    assert outcome.failures == []
    assert sum(outcome.sent.values()) == 10_000
    assert outcome.kinds > 12
