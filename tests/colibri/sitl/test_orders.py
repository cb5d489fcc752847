from typing import Any

import pytest

from colibri.sitl.backends.setting import Setting, SettingError, setting_of
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl
from tests.support.refusals import refusal_of


def test_a_takeoff_without_a_height_uses_the_parameter() -> None:
    with Flights(Setting(params={"MIS_TAKEOFF_ALT": 1.5}), None) as flights:
        sitl = flights.begin(start={"x": 2.0})
        sitl.takeoff()
        assert sitl.is_at((2.0, 0.0, 1.5))
        sitl.takeoff(2.0)
        assert sitl.is_at((2.0, 0.0, 2.0))


@pytest.mark.parametrize("ground", [{}, {"loss": 0.3, "jitter_s": 0.05}])
def test_sticks_are_heard_as_soon_as_they_are_held(ground: dict[str, float]) -> None:
    with Flights(Setting(airborne=3.0, ground=ground), None) as flights:
        sitl = flights.begin()
        with sitl.sticks_held(pitch=1.0):
            sitl.select("position")
        assert sitl.mode == "position"


@pytest.mark.sitl(airborne=3.0)
def test_an_assertion_shows_the_vehicle(sitl: Sitl) -> None:
    assert repr(sitl) == f"<vehicle 1: {sitl}>"
    assert repr(sitl).startswith("<vehicle 1: t = 0.")


@pytest.mark.sitl(airborne=3.0)
def test_what_there_is_not_is_refused_with_what_there_is(sitl: Sitl) -> None:
    with pytest.raises(ValueError, match=r'^unknown mode "holdd" \(did you mean "hold"\?\)$'):
        sitl.select("holdd")
    with pytest.raises(ValueError, match=r'^unknown track "wavy" \(did you mean "wave"\?\)$'):
        sitl.fly_track("wavy")
    with pytest.raises(ValueError, match=r'^unknown unit of a failure "motorr" \(did you mean "motor"') as refused:
        sitl.inject("motorr", "off")
    assert refused.traceback[-1].ishidden(refused), "a test shows its own lines"
    with pytest.raises(ValueError, match=r'^unknown message "COLISION" \(did you mean "COLLISION"'):
        sitl.heard("COLISION")
    with pytest.raises(sitl.Refused, match=r"^parameter MPC_CRUISE was refused: does not exist \(result 1\)$"):
        sitl.set_param("MPC_CRUISE", 3.0)
    with pytest.raises(ValueError, match=r"^seconds to fly must be from 0 on, not -1$"):
        sitl.run(-1)
    with pytest.raises(AttributeError, match=r'^unknown attribute to set "wimd" .*"wind"'):
        setattr(sitl, "wimd", "5@270")  # noqa: B010 - a checker refuses it, too
    with pytest.raises(AttributeError, match=r'unknown link "grund" .did you mean "ground"'):
        sitl.link.grund.loss = 0.1
    with pytest.raises(AttributeError, match=r'unknown fault of a link "lost" .did you mean "loss"'):
        sitl.link.ground.lost = 0.1
    for name, value in {"loss": 3, "delay_s": -1.0, "jitter_s": "1"}.items():
        with pytest.raises(ValueError, match=f"^{name} of a link must be from 0 .*, not {value!r}"):
            setattr(sitl.link.ground, name, value)


@pytest.mark.parametrize(
    ("failure", "reason"),
    [
        (("gps", "off"), 'feedback is "state", and sensors are not used: set feedback="sensors"'),
        (("accel", "stuck", 1), 'feedback is "state"'),
        (("airspeed", "off"), "choose one of gyro, accel, mag, baro, gps, distance_sensor, battery, motor"),
        (("motor", "garbage"), "choose one of ok, off, stuck, wrong"),
        (("motor", "off", 7), "instance must be 0 to 4"),
        (("motor", "wrong", 1, 3.0), "remaining fraction must be 0.001 to 1"),
    ],
)
@pytest.mark.sitl(airborne=3.0)
def test_a_refused_failure_says_what_is_possible(sitl: Sitl, failure: tuple[Any, ...], reason: str) -> None:
    assert f"was refused: {reason}" in refusal_of(sitl.inject, *failure)


@pytest.mark.parametrize(
    ("mark", "line"),
    [
        ({"airborne": 5, "feedback": "sensors"}, 'airborne requires feedback="state":'),
        ({"airborne": "five"}, "airborne: must be a number m, not five"),
        ({"vehicle": 3}, "vehicle: must be a name or a Vehicle, not int"),
        ({"params": 3}, "params: must be a Mapping, not int"),
        ({"params": "q"}, "params: must be KEY=VALUE,... in numbers, not q"),
        ({"start": "q"}, "start: q: must be a number, not empty"),
        ({"ground": {"loss": 7}}, "loss of a link must be from 0 to 1, not 7"),
        ({"ground": "down=1"}, 'ground: unknown fault "down" (choose corrupt, '),
    ],
)
def test_what_no_flight_begins_with(mark: dict[str, Any], line: str) -> None:
    assert refusal_of(setting_of, [mark]).startswith(line)


def test_what_differs_for_one_flight_is_read_as_a_mark() -> None:
    with Flights(Setting(params={"MIS_TAKEOFF_ALT": 1.5}), None) as flights:
        sitl = flights.begin(start="x=3", params={"RTL_RETURN_ALT": 7.0})
        assert sitl.position[0] == 3.0
        assert [sitl.get_param(name) for name in ("MIS_TAKEOFF_ALT", "RTL_RETURN_ALT")] == [1.5, 7.0]
        with pytest.raises(SettingError, match='unknown option "place"'):
            flights.begin(place=3)
