"""A live vehicle, whose link a thread serves."""

from collections.abc import Callable
from threading import Event, Lock, Thread
from time import perf_counter

from colibri.mavlink.links.link import LinkError
from colibri.mavlink.links.open import open_ground_link
from colibri.view.observer import VehicleObserver
from colibri.view.snapshot import Chart, Snapshot, Surroundings, VehicleShape, ViewError

_WAIT_S = 0.02


class ObservedVehicle:
    """A vehicle by its messages; its airframe is drawn by the number of rotors alone."""

    is_live = True
    span_s = (0.0, 0.0)

    def __init__(self, name: str, observer: VehicleObserver) -> None:
        self.name = name
        self._observer = observer
        self._lock = Lock()

    @property
    def surroundings(self) -> Surroundings:
        with self._lock:
            return self._observer.surroundings

    @property
    def autopilot(self) -> int | None:
        """MAV_AUTOPILOT; `None` before the first heartbeat."""
        with self._lock:
            return self._observer.telemetry.autopilot

    @property
    def airframe(self) -> VehicleShape:
        with self._lock:
            return VehicleShape.of(self._observer.telemetry.rotors)

    def at(self, time_s: float) -> Snapshot:
        with self._lock:
            return self._observer.telemetry.snapshot(time_s)

    def charts(self) -> tuple[Chart, ...]:
        with self._lock:
            return self._observer.telemetry.charts()

    def order(self, give: Callable[[VehicleObserver], None]) -> None:
        """Call a command of the observer: `live.order(Observer.land)`."""
        with self._lock:
            give(self._observer)


class LiveVehicle(ObservedVehicle):
    """The vehicle at the other end of a link."""

    def __init__(self, url: str, name: str = "") -> None:
        try:
            self._link = open_ground_link(url)
        except LinkError as error:
            raise ViewError(str(error)) from error
        self.url = self._link.url
        super().__init__(name or self.url, VehicleObserver())
        self._ends = Event()
        self._peers = [self._link.target] if self._link.target else []
        self._thread = Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ends.set()
        self._thread.join()
        self._link.close()

    def _serve(self) -> None:
        while not self._ends.is_set():
            self._link.wait(_WAIT_S)
            received = self._link.receive_now()
            self._peers += [address for address in self._link.take_opened() if address not in self._peers]
            for gone in self._link.take_closed():
                self._peers = [address for address in self._peers if address != gone]
            now_s = perf_counter()
            with self._lock:
                for datagram, address in received:
                    if address not in self._peers:
                        self._peers.append(address)
                    self._observer.receive(datagram, now_s)
                for note in self._link.take_notes():
                    self._observer.telemetry.say(note)
                outbox = self._observer.poll(now_s)
            for datagram in outbox:
                for address in self._peers:
                    self._link.send(datagram, address)
