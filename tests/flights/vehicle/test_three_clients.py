"""Two ground stations and an offboard companion at once, in memory: what `make soak-clients` does for long."""

import gc

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK
from tools.soak.clients import HarnessStation, crew, faults

pytestmark = QUICK

LASTS_S = 14.0
WARM_S = 6.0
MAX_NEW_OBJECTS = 100


def connect(sitl: Sitl, client: HarnessStation, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a client answer what comes with the next frame."""
    link = sitl.client(*client.identity)

    def arriving(datagram: bytes, now_us: int) -> None:
        for answer in client.receive(datagram, now_us * 1e-6):
            link.send_raw(answer)

    monkeypatch.setattr(link, "arriving", arriving)


def objects(sitl: Sitl) -> int:
    sitl.gcs.forget()
    gc.collect()
    return len(gc.get_objects())


def test_three_clients_at_once_are_each_served(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    sitl.gcs.silent = True
    clients = crew()
    for client in clients:
        connect(sitl, client, monkeypatch)
    sitl.run(WARM_S)
    before = objects(sitl)
    sitl.run(LASTS_S - WARM_S)
    assert faults(clients) == []
    assert objects(sitl) - before < MAX_NEW_OBJECTS
    assert sitl.mode is Mode.OFFBOARD
    assert all(sum(client.acks.values()) > 20 for client in clients)
