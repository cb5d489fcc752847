"""The reference generator: what it remembers of a reference that stays is what leading it anew would give."""

from collections.abc import Callable

import numpy as np
import pytest

from colibri.autopilot.commander.flight.reference_generator import ReferenceGenerator
from colibri.autopilot.control.interface import Horizon, Pace, Preview, VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.guidance import instants
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.reference import Reference, at_rest, lead, still_target
from colibri.autopilot.guidance.tasks.task import PositionMotion, TaskContext

SAMPLES, INTERVAL_US = 30, 8_000
STATE = VehicleState((1.0, -2.0, 3.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 7.0), (0.0, 0.0, 0.0))
HERE = PositionMotion(still_target(STATE.position_enu_m, 0.7, SAMPLES), Limits())
THERE = PositionMotion(still_target((1.0, -2.0, 3.5), 0.7, SAMPLES), Limits())


class Lead:
    """A reference that is led sample after sample, and beside it what `lead` makes of the same."""

    def __init__(self) -> None:
        self.generator = ReferenceGenerator(instants(Preview(INTERVAL_US, SAMPLES), INTERVAL_US), Limits())
        self.generator.set(at_rest(STATE))

    def sample(self, wanted: PositionMotion, *, waited: bool = False) -> Horizon:
        before = self.generator.reference
        assert before is not None
        context = TaskContext(0, STATE, before, (0.0, 0.0, 0.0), Behaviour(), INTERVAL_US * 1e-6, SAMPLES)
        given = self.generator.lead(context, wanted)
        horizon, after = lead(before, wanted.target, wanted.limits, INTERVAL_US * 1e-6, waited=waited)
        assert [column.tobytes() for column in given] == [column.tobytes() for column in horizon]
        assert self.generator.reference is not None
        assert bits(self.generator.reference) == bits(after)
        return given

    def rest(self) -> Horizon:
        """Stay until nothing is made anew any more."""
        given = self.sample(HERE)
        for _ in range(3000):
            before, given = given, self.sample(HERE)
            if given is before:
                return given
        raise AssertionError("it never stays")


def bits(reference: Reference) -> tuple[bytes, bytes]:
    return reference.motion.tobytes(), reference.heading.tobytes()


def at_once(lead: Lead) -> None:
    lead.sample(THERE)


def set_elsewhere(lead: Lead) -> None:
    lead.generator.follow(STATE._replace(position_enu_m=(1.0, -2.0, 2.9)))


def set_where_it_is(lead: Lead) -> None:
    assert lead.generator.reference is not None
    lead.generator.set(lead.generator.reference)


@pytest.mark.parametrize("happens", [at_once, set_elsewhere, set_where_it_is], ids=lambda it: it.__name__)
def test_a_cached_reference_equals_one_led_anew(happens: Callable[[Lead], None]) -> None:
    led = Lead()
    led.rest()
    happens(led)
    for _ in range(20):
        led.sample(HERE)
    for _ in range(20):
        led.sample(THERE)
    led.rest()


def test_a_reference_that_waits_is_led_anew() -> None:
    led = Lead()
    kept = led.rest()
    led.generator.wait(0.003, 0.5)
    given = led.sample(HERE._replace(pace=Pace.WAITING), waited=True)
    assert given is not kept
    assert np.array_equal(given.position_enu_m, kept.position_enu_m)
    led.generator.wait(0.0, 1.0)
    led.rest()
