"""A mission of 500 items, up and down through sockets and a relay that loses 20 % each way."""

import struct
from pathlib import Path

import pytest

from tests.clients.support.plan_client import ACCEPTED, Item, PlanClient
from tests.support.mission_ends import some_item
from tools.harness.relay import BadLink
from tools.harness.sitl_process import vehicle

SPEED = 10.0
"""The vehicle asks again after a quarter of a simulated second."""
PLAN: list[Item] = [tuple(some_item(number)) for number in range(500)]


def bits(items: list[Item]) -> list[bytes]:
    """Return items as they lie on the wire: nan is equal to nan there."""
    return [struct.pack("<BHB4fiif", *item) for item in items]


@pytest.mark.long
@pytest.mark.parametrize("seed", [1])
def test_500_items_over_a_link_that_loses_a_fifth_each_way(tmp_path: Path, seed: int) -> None:
    with vehicle(tmp_path, speed=SPEED) as flown, BadLink(f"udpout:127.0.0.1:{flown.port}", seed) as relay:
        client = PlanClient(relay.url)
        assert client.upload(PLAN) == ACCEPTED
        assert bits(client.download()) == bits(PLAN)
        client.close()
    assert client.said_again > 100
    assert relay.counts["lost"] > 300
