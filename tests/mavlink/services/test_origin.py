"""SET_GPS_GLOBAL_ORIGIN, SET_HOME_POSITION and SET_MODE."""

from collections.abc import Iterable

import pytest

from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.node.service import Send
from colibri.mavlink.services.origin import OriginService, Setters
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.wire.dialect import Message, Refusal
from tests.support.messages import GROUND, message, on_the_wire

Q = [1.0, 0.0, 0.0, 0.0]


class Vehicle:
    def __init__(self, reason: str = "") -> None:
        self.refusal = Refusal(reason) if reason else None
        self.told: list[object] = []
        self.service = OriginService(Setters(self.take, self.take, self.take_mode), StatusText())

    def take(self, place: Geodetic) -> Refusal | None:
        self.told.append(place)
        return self.refusal

    def take_mode(self, base: int, custom: int) -> Refusal | None:
        self.told.append((base, custom))
        return self.refusal

    def hear(self, received: Message) -> list[Message]:
        sends: Iterable[Send] = self.service.receive(received, GROUND, 1_000_000)
        return on_the_wire(list(sends))


def origin(latitude: int, longitude: int, altitude: int) -> Message:
    return message("SET_GPS_GLOBAL_ORIGIN", 1, latitude, longitude, altitude)


def home(latitude: int, longitude: int, altitude: int) -> Message:
    return message("SET_HOME_POSITION", 1, latitude, longitude, altitude, 0, 0, 0, Q, 0, 0, 0)


def test_the_origin_is_answered_with_the_integers_that_were_sent() -> None:
    vehicle = Vehicle()
    (answer,) = vehicle.hear(origin(473977423, -85455947, 488123))
    assert answer.name == "GPS_GLOBAL_ORIGIN"
    fields = answer.fields
    assert (fields.latitude, fields.longitude, fields.altitude) == (473977423, -85455947, 488123)
    assert vehicle.told == [pytest.approx(Geodetic(47.3977423, -8.5455947, 488.123))]


def test_home_and_mode_are_not_answered() -> None:
    vehicle = Vehicle()
    assert vehicle.hear(home(473977423, 85455947, 488000)) == []
    assert vehicle.hear(message("SET_MODE", 1, 209, 50593792)) == []
    assert vehicle.told == [pytest.approx(Geodetic(47.3977423, 8.5455947, 488.0)), (209, 50593792)]


@pytest.mark.parametrize("received", [origin(1, 2, 3), home(1, 2, 3), message("SET_MODE", 1, 1, 99)])
def test_a_refusal_is_told_in_words(received: Message) -> None:
    (answer,) = Vehicle("because").hear(received)
    assert answer.name == "STATUSTEXT"
    assert answer.fields.text == "because"


@pytest.mark.parametrize("make", [origin, home])
@pytest.mark.parametrize(
    ("place", "fault"),
    [
        ((900000001, 0, 0), "latitude 90"),
        ((5, -1800000001, 0), "longitude -180"),
        ((-(2**31), 2**31 - 1, 0), "latitude -214.7484"),
        ((0, 0, 488_000), "latitude 0, longitude 0"),
        ((5, 0, 10_000_001), "altitude 10000"),
        ((5, 0, -10_000_001), "altitude -10000"),
    ],
)
def test_what_is_no_place_is_never_handed_on(make: object, place: tuple[int, int, int], fault: str) -> None:
    vehicle = Vehicle()
    assert callable(make)
    text, *_ = vehicle.hear(make(*place))
    assert text.name == "STATUSTEXT"
    assert f"refused: {fault}" in text.fields.text
    assert vehicle.told == []
