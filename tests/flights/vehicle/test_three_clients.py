"""Two ground stations and an offboard companion at once, in memory: what `make soak-clients` does for long."""

import gc

from colibri.autopilot.commander.rules.modes import Mode
from tools.harness.client import Client
from tools.harness.copter_flight import CopterFlight
from tools.harness.stations import Station
from tools.soak.clients import crew, faults

LASTS_S = 20.0
WARM_S = 8.0
MAX_NEW_OBJECTS = 100


class Talking(Client):
    """A client that answers what comes with the next frame."""

    def __init__(self, station: Station, port: int) -> None:
        super().__init__(*station.identity, port=port)
        self._station = station
        self.now_s = 0.0

    def receive(self, datagram: bytes) -> None:
        for answer in self._station.receive(datagram, self.now_s):
            self.send_raw(answer)


def test_three_clients_at_once_are_served_each_for_itself() -> None:
    clients = crew()
    talking = [Talking(client, 16000 + number) for number, client in enumerate(clients)]
    flight = CopterFlight(client=talking[0])
    for client in talking[1:]:
        flight.add(client)

    def tick() -> None:
        for client in talking:
            client.now_s = flight.time_s

    flight.run(WARM_S, tick)
    gc.collect()
    before = len(gc.get_objects())
    flight.run(LASTS_S - WARM_S, tick)
    gc.collect()
    assert faults(clients) == []
    assert len(gc.get_objects()) - before < MAX_NEW_OBJECTS
    assert flight.mode is Mode.OFFBOARD
    assert all(sum(client.acks.values()) > 20 for client in clients)
