"""Any messages in any mode: a vehicle that nothing makes raise, nor turn a rotor while disarmed, nor fly nonsense.

The long version is `python -m tools.fuzz`.
"""

import pytest

from tools.fuzz.vehicle import ground_campaign


@pytest.mark.parametrize(("count", "seed"), [(8_400, 1), pytest.param(25_000, 2, marks=pytest.mark.long)])
def test_messages_by_the_thousand_in_every_mode(count: int, seed: int) -> None:
    outcome = ground_campaign(count, seed=seed)
    assert outcome.failures == []
    assert sum(outcome.sent.values()) == count
    assert outcome.kinds > 12
