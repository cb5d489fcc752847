"""Whatever is said of a flight, plant and autopilot read back from their command lines."""

from math import inf
from pathlib import Path

from colibri.autopilot.__main__ import command_line as autopilot_command_line
from colibri.flights.command_lines import options_of, plant_options
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.__main__ import command_line as plant_command_line
from colibri.plant.environment.weather import Gust, Wind
from colibri.plant.physics.start import Start
from colibri.plant.simulation.setting import WorldSetting, world_values
from colibri.sitl.backends.setting import Setting

WORLD = WorldSetting(
    without=("drag", "ground"),
    wind=Wind(5.0, 270.0),
    gusts=(Gust(Wind(6.0, 90.0), 10.0, 2.0), Gust(Wind(1.5, 0.0), 0.0, 0.1)),
    turbulence="light",
    seed=7,
    start=Start(x=-1.5, psi=90.0, rotors=1e-7),
    latency=12.5,
)


def test_a_plant_reads_back_its_world() -> None:
    args = plant_command_line().parse_args(plant_options(WORLD, speed=inf, duration=3.0, truth=True, out=None))
    assert world_values(args) == world_values(WORLD) | {"start": WORLD.start._asdict()}
    assert (args.speed, args.duration, args.truth, args.out) == (inf, 3.0, True, None)


def test_what_is_not_said_is_as_it_is_by_default() -> None:
    assert plant_command_line().parse_args(plant_options(WorldSetting())) == plant_command_line().parse_args([])
    assert options_of(solver=None, gcs=(), insecure=False, start={}) == []


def test_an_autopilot_reads_back_links_paths_and_feedback() -> None:
    options = options_of(gcs=["udpout:[::1]:1", "tcpin:0"], state=Path("a b"), feedback=Feedback.SENSORS, insecure=True)
    args = autopilot_command_line().parse_args(options)
    assert (args.gcs, args.state) == (["udpout:[::1]:1", "tcpin:0"], Path("a b"))
    assert (args.feedback, args.insecure) == (Feedback.SENSORS, True)


def test_a_setting_is_understood_by_both() -> None:
    setting = Setting(gusts=("6@270:start=10,duration=2",), start={"x": -3.0}, home="47,8,400,10", controller="lpv-mpc")
    plant = plant_command_line().parse_args(setting.plant_options(4000.0))
    assert (plant.start["x"], plant.start["psi"], plant.truth) == (-3.0, 90.0, True)
    autopilot = autopilot_command_line().parse_args(setting.autopilot_options(Path("state")))
    assert (autopilot.controller, autopilot.home) == ("lpv-mpc", plant.home)
