from argparse import Namespace
from dataclasses import dataclass, field, fields, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any

import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.arguments import ArgumentParser
from colibri.common.spec import Option, SpecError, add_options, from_json, from_namespace, from_values, part_of, to_json
from colibri.flights.fleet_spec import FleetSpec
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.environment.weather import Gust, RecordedWind, Wind
from colibri.plant.physics.start import Start
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.backends.setting import Setting
from tests.support.refusals import refusal_of

WORLD: dict[str, Any] = {
    "without": ("drag", "ground"),
    "wind": Wind(5.0, 270.0),
    "gusts": (Gust(Wind(6.0, 90.0), 10.0, 2.0), Gust(Wind(1.5, 0.0), 0.0, 0.1)),
    "turbulence": "light",
    "seed": 7,
    "start": {"x": -1.5, "psi": 90.0, "rotors": 1e-7},
    "latency": 12.5,
}
PLANT = PlantSpec(**WORLD, speed=inf, duration=3.0, truth=True, out=Path("a b"))
AUTOPILOT = AutopilotSpec(
    gcs=("udpout:[::1]:1", "tcpin:0"), feedback=Feedback.SENSORS, insecure=True, floor=-inf, params={"A": 1, "B": 0.5}
)
OBJECTS = FlightSpec(
    track="spiral",
    profile=load_profile("flight").replace("delay_s", 0.01),
    vehicle=load_vehicle("iris").replace("body.mass_kg", 2.0),
    wind=RecordedWind(Path("wind.csv"), (0.0, 1.0), ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0))),
)


@dataclass(frozen=True, kw_only=True)
class Base:
    speed: Annotated[float | None, Option("how fast", "N", above=0.0, endless=True)] = None
    names: Annotated[tuple[str, ...], Option("who")] = ()


@dataclass(frozen=True, kw_only=True)
class Example(Base):
    track: Annotated[str, Option("what to fly", "TRACK")]
    log: Annotated[bool, Option("write no log")] = True
    start: Annotated[dict[str, float], Option("where", read=lambda text: {"x": float(text)})] = field(
        default_factory=dict
    )


def read(*words: str) -> Example:
    parser = ArgumentParser(prog="example")
    add_options(parser, Example)
    return from_namespace(Example, parser.parse_args(words))


def test_a_command_line_is_read() -> None:
    assert read("hover") == Example(track="hover")
    words = ("hover", "--speed", "max", "--names", "a", "--names", "b", "--no-log", "--start", "2")
    assert read(*words) == Example(track="hover", speed=inf, names=("a", "b"), log=False, start={"x": 2.0})


def test_values_are_pythons_or_texts() -> None:
    given = {
        "wind": "5@270",
        "gusts": "6@270:start=10,duration=2",
        "without": "drag",
        "seed": "3",
        "start": Start(x=1.0),
    }
    spec = FlightSpec.of("hover", **given, feedback="sensors", out="out", turbulence=None)
    assert (spec.wind, spec.without, spec.seed) == (Wind(5.0, 270.0), ("drag",), 3)
    assert (spec.gusts, spec.start["x"]) == ((Gust(Wind(6.0, 270.0), 10.0, 2.0),), 1.0)
    assert (spec.feedback, spec.out, spec.turbulence) == (Feedback.SENSORS, Path("out"), None)


@pytest.mark.parametrize("spec", [PLANT, AUTOPILOT, OBJECTS], ids=["plant", "autopilot", "objects"])
def test_json_is_read_back(spec: Any) -> None:
    assert from_json(type(spec), to_json(spec)) == spec


def test_json_leaves_defaults_out() -> None:
    assert to_json(PlantSpec()) == b"{}"


def test_code_is_not_json() -> None:
    with pytest.raises(SpecError, match=r"^controller: an object cannot be passed to another process: use a name$"):
        to_json(replace(OBJECTS, controller=ArgumentParser))


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"lattency": 1.0}, 'unknown option "lattency" (did you mean "latency"?)'),
        ({"latency": 2000.0}, "latency: must be a number from 0 to 1000 ms, not 2000.0"),
        ({"latency": "fast"}, "latency: must be a number from 0 to 1000 ms, not fast"),
        ({"seed": -1}, "seed: must be a whole number of at least 0, not -1"),
        ({"seed": 1.5}, "seed: must be a whole number of at least 0, not 1.5"),
        ({"seed": True}, "seed: must be a whole number of at least 0, not True"),
        ({"duration": "max"}, "duration: must be a number above 0 s, not max"),
        ({"speed": 0.0}, "speed: must be a number above 0, or max, not 0.0"),
        ({"feedback": "sensor"}, 'feedback: unknown value "sensor" (did you mean "sensors"?)'),
        ({"turbulence": "some"}, 'turbulence: unknown value "some" (choose light, moderate, severe)'),
        ({"start": {"z": "high"}}, 'start: z: must be a number, not "high"'),
        ({"start": "zz=1"}, 'start: unknown key "zz" (did you mean "z"?)'),
        ({"profile": 3}, "profile: must be a name or a Profile, not int"),
        ({"gusts": [3]}, "gusts: must be SPEED@FROM:start=S,duration=S, not int"),
        ({"wind": "strong"}, "wind: must be SPEED@FROM in m/s and degrees, for example 5@270, not strong"),
    ],
)
def test_a_wrong_value_is_named_with_what_is_valid(given: dict[str, Any], line: str) -> None:
    assert refusal_of(from_values, FlightSpec, {"track": "hover", **given}) == line


def test_a_command_line_names_the_option(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        read("hover", "--speed", "0")
    assert ended.value.code == 2
    line = "argument --speed: must be a number above 0, or max, not 0 (see example --help)"
    assert capsys.readouterr().err == f"colibri: error: {line}\n"


def test_a_part_has_the_same_values() -> None:
    part = part_of(FlightSpec(track="spiral", **WORLD, delay=3.0), PlantSpec, vehicle="iris", integrator="rk4")
    assert part == PlantSpec(**WORLD, vehicle="iris", link="memory", duration=100.0, out=Path("out"))


@pytest.mark.parametrize("spec", [PlantSpec, AutopilotSpec, FlightSpec, FleetSpec, Setting])
def test_defaults_are_read_from_an_empty_command_line(spec: Any) -> None:
    parser = ArgumentParser(prog="example")
    add_options(parser, spec)
    words = ["spiral"] if spec is FlightSpec else []
    expected = spec(track="spiral") if spec is FlightSpec else spec()
    assert from_namespace(spec, parser.parse_args(words)) == expected
    assert all(each.help for each in parser._actions), [each.name for each in fields(spec)]  # noqa: SLF001


def test_a_namespace_may_lack_what_a_command_leaves_out() -> None:
    assert from_namespace(Base, Namespace(speed=2.0)) == Base(speed=2.0)
