"""Events of a flight: read as texts, tables and structs, and felt by the plant at their time."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import colibri
from colibri.cli.main import main
from colibri.common.spec import from_json, from_values, to_json
from colibri.flights.fleet_spec import FleetSpec
from colibri.flights.provenance import plan_of
from colibri.flights.replay import replay_flight
from colibri.flights.spec import FlightSpec
from colibri.mavlink.client.events import Mode, Setpoint
from colibri.plant.environment.weather import Wind
from colibri.plant.events import Blow, Failure, Motor, Payload
from colibri.plant.spec import PlantSpec, WorldSpec
from colibri.sitl.backends.setting import Setting, setting_of
from tests.support.commands import Refused
from tests.support.refusals import refusal_of

EVENTS = {
    "5:payload=0.2": Payload(t=5.0, kg=0.2),
    "0:wind=6@270": Blow(t=0.0, wind=Wind(6.0, 270.0)),
    "2.5:motor=2": Motor(t=2.5, rotor=2),
    "2:motor=0,0.65": Motor(t=2.0, rotor=0, fraction=0.65),
    "3:failure=gps,off": Failure(t=3.0, unit="gps", type="off"),
    "3:failure=motor,wrong,1,0.8": Failure(t=3.0, unit="motor", type="wrong", instance=1, values=(0.8,)),
    "4:mode=land": Mode(t=4.0, mode="land"),
    "4:mode=takeoff,arm": Mode(t=4.0, mode="takeoff", arm=True),
    "4:setpoint=1,2,3": Setpoint(t=4.0, position=(1.0, 2.0, 3.0)),
}


@pytest.mark.parametrize(("text", "struct"), EVENTS.items())
@pytest.mark.parametrize("spec", [WorldSpec, PlantSpec, FleetSpec, FlightSpec, Setting])
def test_texts_tables_and_structs_are_the_same_events(text: str, struct: Any, spec: type, tmp_path: Path) -> None:
    file = tmp_path / "events.toml"
    table = msgspec.to_builtins(struct)
    rows = (f"{key} = {json.dumps(value)}" for key, value in table.items())
    file.write_text("\n".join(["[[events]]", *rows]), encoding="utf-8")
    track = {"track": "hover"} if spec is FlightSpec else {}
    for given in (text, [text], table, (table,), struct, [struct], str(file), file):
        assert from_values(spec, {"events": given, **track}).events == (struct,)
    whole: Any = from_values(spec, {"events": [text], **track})
    assert from_json(spec, to_json(whole)).events == (struct,)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("payload=0.2", "must be T:KIND=VALUE with payload=KG, wind=SPEED@FROM|FILE.csv, failure=UNIT"),
        ("x:payload=0.2", 'not "x:payload=0.2"'),
        ("5:payload", 'not "5:payload"'),
        ("5:payload=heavy", 'not "5:payload=heavy"'),
        ("nan:payload=1", 'not "nan:payload=1"'),
        ("5:motor=1,0.5,3", 'not "5:motor=1,0.5,3"'),
        ("5:failure=gps", 'not "5:failure=gps"'),
        ("5:payload=-1", "payload: Expected float >= 0.0 - at $.kg"),
        ("5:payload=101", "payload: Expected float <= 100.0 - at $.kg"),
        ("-1:payload=1", "payload: Expected float >= 0.0 - at $.t"),
        ("5:motor=7", "event motor at t = 5 s: instance must be 0 to 4"),
        ("5:motor=1.5", 'not "5:motor=1.5"'),
        ("5:paylod=1", 'unknown event "paylod" (did you mean "payload"?)'),
        ("5:failure=gsp,off", 'unknown FAILURE_UNIT "gsp" (did you mean "gps"?)'),
        ("5:failure=gps,of", 'unknown FAILURE_TYPE "of" (did you mean "off"?)'),
        ("5:wind=fast", "wind: must be SPEED@FROM"),
        ("5:wind=none.csv", "none.csv: No such file"),
        ("none.toml", "none.toml: No such file"),
        (3, 'an event must be a table or a text T:KIND=VALUE|FILE.toml, not int "3"'),
        ({"event": "payload", "kg": 1}, "payload: Object missing required field t"),
        ({"t": 1, "event": "payload", "kilos": 1}, "payload: Object contains unknown field kilos"),
        ({"t": 1}, 'an event needs the key "event" (choose payload, wind'),
        ({"t": float("nan"), "event": "payload", "kg": 1}, "payload: Expected float >= 0.0 - at $.t"),
        ({"t": float("inf"), "event": "payload", "kg": 1}, "payload: t and values must be finite"),
        ("4:mode=takeoff,am", 'not "4:mode=takeoff,am"'),
        ({"t": 1, "event": "wind", "wind": lambda t: (t,)}, "wind: a function must return three numbers"),
        ({"t": 1, "event": "wind", "wind": lambda _: 1 / 0}, "wind: the function raised ZeroDivisionError at t = 0 s"),
        ("4:mode=land", "event mode at t = 4 s needs ground stations: fly it by colibri fly --gcs"),
        ("4:setpoint=0,0,1", "event setpoint at t = 4 s needs ground stations: fly it by colibri fly --gcs"),
        ("4:failure=gps,off", "event failure at t = 4 s: flown by the state, not by sensors"),
        ("4:failure=motor,wrong,1,3", "event failure at t = 4 s: remaining fraction must be 0.001 to 1"),
        ("4:failure=motor,off,9", "event failure at t = 4 s: instance must be 0 to 4"),
        ("4:failure=motor,garbage", "event failure at t = 4 s: no plant does this fault"),
    ],
)
def test_wrong_events_are_refused_in_one_line(given: Any, said: str) -> None:
    assert said in refusal_of(colibri.fly, "hover", events=[given], duration=0.1)


FLOWN: dict[str, tuple[Any, str, float, float]] = {
    "payload": ("0.1:payload=0.3", "z", 1e-3, 1.0),
    "wind": ({"t": 0.1, "event": "wind", "wind": "9@270"}, "x", 1e-4, 1.0),
    "function": ({"t": 0.1, "event": "wind", "wind": lambda t: (20.0 * t, 0.0, 0.0)}, "x", 1e-5, 1.0),
    "motor": ("0.1:motor=1,0.6", "theta", 1e-3, 1.0),
    "failure": ("0.1:failure=motor,wrong,1,0.6", "theta", 1e-3, 1.0),
    "motor of eight": ("0.1:motor=8,0.6", "z", 1e-3, 1.0),
}


@pytest.mark.parametrize(
    ("event", "column", "low", "high"),
    [pytest.param(*each, id=name, marks=pytest.mark.long if "eight" in name else ()) for name, each in FLOWN.items()],
)
def test_an_event_acts_from_its_time_on(event: Any, column: str, low: float, high: float) -> None:
    options: dict[str, Any] = {"duration": 0.4, "vehicle": "hummingbird"}
    if "=8" in event:  # by the law with less machine code for other numbers of rotors
        options |= {"vehicle": "s1000", "controller": "geometric-se3"}
    calm = colibri.fly("hover", **options)
    flights = [colibri.fly("hover", events=[event], link=link, **options) for link in ("memory", "memory", "direct")]
    (flight, again, direct) = flights
    before = flight.frames["t"] <= 0.1
    assert flight.frames[before].tobytes() == calm.frames[before].tobytes()
    assert low < abs(flight.samples[column][-1] - calm.samples[column][-1]) < high
    assert again.sha256 == flight.sha256
    np.testing.assert_allclose(direct.samples["z"], flight.samples["z"], atol=1e-4)


def test_both_links_record_and_replay_the_same_events(tmp_path: Path) -> None:
    events = ["--event", "0.1:payload=0.3", "--event", "0.2:motor=1,0.8"]
    hashes = []
    for link in ("memory", "udp"):
        out = tmp_path / link
        words = ["fly", "hover", "--duration", "0.4", "--link", link, "--no-figures", "--quiet", "--out", str(out)]
        assert main([*words, *events]) == 0
        assert replay_flight(out).difference is None
        plan = plan_of(out)
        assert plan.spec.events == (Payload(t=0.1, kg=0.3), Motor(t=0.2, rotor=1, fraction=0.8))
        hashes.append(colibri.load_flight(out).sha256)
    again = colibri.fly("hover", duration=0.4, events=plan.spec.events)
    assert {*hashes, again.sha256} == {again.sha256}


def test_a_campaign_sweeps_events() -> None:
    levels = {"calm": {}, "loaded": {"events": [{"t": 0.1, "event": "payload", "kg": 0.3}]}}
    results = colibri.campaign(fly={"track": "hover", "duration": 0.3}, grid={"load": levels}, workers=1)
    assert [str(each.verdict) for each in results.flown] == ["flown", "flown"]
    assert len({each.sha256 for each in results.flown}) == 2


def test_events_without_effect_are_named() -> None:
    with pytest.warns(colibri.NoEffectWarning, match="each is after the flight"):
        colibri.fly("hover", duration=0.1, events=["5:payload=0.2"])


@pytest.mark.sitl(events=["2:payload=0.05", "5:setpoint=1,0,2.5", "5.2:mode=offboard", "8:mode=land"])
def test_the_fixture_flies_events_of_plant_and_station(sitl: colibri.Sitl) -> None:
    sitl.takeoff(2.0)
    assert sitl.time_s < 5.0
    sitl.wait_until(lambda: sitl.mode == "offboard" and sitl.is_at((1.0, 0.0, 2.5)), within=10.0)
    sitl.wait_until(lambda: sitl.mode == "land", within=10.0)


@pytest.mark.long
def test_modes_and_setpoints_fly_beside_ground_stations(tmp_path: Path) -> None:
    words = ["fly", "hover", "--duration", "3.5", "--link", "udp", "--gcs", "udpin:127.0.0.1:0", "--speed", "max"]
    events = ["--event", "0.5:setpoint=1,0,3", "--event", "0.7:mode=offboard", "--event", "0.8:payload=0.05"]
    hashes = set()
    for out in (tmp_path / "one", tmp_path / "two"):
        assert main([*words, *events, "--no-figures", "--quiet", "--out", str(out)]) == 0
        flight = colibri.load_flight(out)
        hashes.add(flight.sha256)
        np.testing.assert_allclose([flight.samples[axis][-1] for axis in "xyz"], (1.0, 0.0, 3.0), atol=0.2)
    assert len(hashes) == 1
    assert replay_flight(out).difference is None


@pytest.mark.parametrize(
    ("event", "said"),
    [
        ("4:mode=lnd", 'events: unknown mode "lnd" (did you mean "land"?)'),
        ("4:failure=gps,off", "events: event failure at t = 4 s: flown by the state"),
    ],
)
def test_the_fixture_refuses_what_it_cannot_fly(event: str, said: str) -> None:
    assert refusal_of(setting_of, [{"events": [event]}]).startswith(said)


@pytest.mark.parametrize("serve", ["px4", "ardupilot-json"])
def test_foreign_autopilots_have_no_events(serve: str, refused: Refused) -> None:
    assert "--event needs --serve colibri" in refused("plant", "--serve", serve, "--event", "1:payload=0.1")


@pytest.mark.parametrize("command", [("sitl",), ("fly", "hover", "--link", "udp", "--gcs", "udpin:127.0.0.1:0")])
def test_unknown_modes_are_refused(command: tuple[str, ...], refused: Refused) -> None:
    assert 'unknown mode "lnd" (did you mean "land"?)' in refused(*command, "--event", "4:mode=lnd")
