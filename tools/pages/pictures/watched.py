"""A simulated flight as a live vehicle of `colibri view`."""

from colibri.mavlink.wire.dialect import Message
from colibri.sitl.ground_station import Station
from colibri.sitl.vehicle import Sitl
from colibri.view.observer import COMPONENT, SYSTEM, VehicleObserver


class Watching(Station):
    observer: VehicleObserver

    def add(self, message: Message) -> None:
        self.observer.receive(message.frame, self._flight.time_us / 1e6)

    def departing(self, now_us: int) -> list[bytes]:
        for datagram in self.observer.poll(now_us / 1e6):
            self.send_raw(datagram)
        return super().departing(now_us)


def watched(sitl: Sitl) -> VehicleObserver:
    station = sitl.client(SYSTEM, COMPONENT, beats=False)
    station.__class__ = Watching
    assert isinstance(station, Watching)
    station.observer = VehicleObserver()
    return station.observer
