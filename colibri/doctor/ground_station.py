"""Call a ground station as a vehicle does, and wait for its heartbeat."""

from collections.abc import Sequence
from time import perf_counter

from colibri.common.types import Address
from colibri.doctor.finding import Finding, Severity
from colibri.flights.fleet_spec import GROUND_PORT
from colibri.mavlink.links.link import GroundLink
from colibri.mavlink.wire.dialect import Codec, mav

_EVERY_S = 1.0


def ground_station(link: GroundLink, within_s: float) -> Finding:
    answers = called(link, within_s)
    if answers is not None:
        return Finding("ground station", Severity.FINE, answers)
    said = f"no heartbeat over {link.url} within {within_s:g} s"
    return Finding("ground station", Severity.FAILED, said, f"start it; have it listen on UDP port {GROUND_PORT}")


def called(link: GroundLink, within_s: float) -> str | None:
    """Describe the first ground station that answers."""
    codec = Codec(1, mav.MAV_COMP_ID_AUTOPILOT1)
    beat = (mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_GENERIC, 0, 0, mav.MAV_STATE_STANDBY, 3)
    stations: set[Address] = set()
    began_s = now_s = beat_at_s = perf_counter()
    while now_s < began_s + within_s:
        stations.update(link.take_opened())
        if now_s >= beat_at_s:
            beat_at_s += _EVERY_S
            for address in stations:
                link.send(codec.encode("HEARTBEAT", *beat), address)
        link.wait(min(beat_at_s, began_s + within_s) - now_s)
        for datagram, (host, port) in link.receive_now():
            stations.add((host, port))
            system = _station(codec, datagram)
            if system is not None:
                return f"system {system} at {host}:{port} answers"
        now_s = perf_counter()
    return None


def _station(codec: Codec, datagram: bytes) -> int | None:
    kinds: Sequence[int] = (mav.MAV_TYPE_GCS, mav.MAV_TYPE_ONBOARD_CONTROLLER)
    beats = (it for it in codec.decode(datagram) if it.name == "HEARTBEAT" and it.fields.type in kinds)
    return next((it.source[0] for it in beats), None)
