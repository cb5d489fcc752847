"""Noise of the plant: its density, whatever the frames, and its seed."""

import numpy as np
import pytest

from colibri.flights.spec import FlightSpec, OptionError
from colibri.plant.environment.random_streams import Noise
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.texts import noise_values
from tests.support.plant_flights import OFF, hummingbird

VEHICLE = hummingbird()


@pytest.mark.parametrize("interval_us", [2_000, 8_000])
def test_noise_has_its_density_at_every_rate(interval_us: int) -> None:
    """White force of density d on a mass m: its velocity has the standard deviation d / m √t."""
    ends = []
    for seed in range(60):
        physics = Physics(VEHICLE, "rk4", noise=Noise({"force": 0.1}, seed))
        world = starting_world(Start(z=900.0), VEHICLE)
        for _ in range(320_000 // interval_us):
            world = physics.step(world, OFF, interval_us)
        ends += [world.state[0], world.state[1]]
    assert np.std(ends) == pytest.approx(0.1 / VEHICLE.body.mass_kg * 0.32**0.5, rel=0.2)


def test_noise_depends_on_seed_and_time_alone() -> None:
    noise = Noise(noise_values("force=0.1,moment=0.01,motors=0.001"), 1)
    assert noise.over(4_000, 4_000) == Noise(noise_values("force=0.1,moment=0.01,motors=0.001"), 1).over(4_000, 4_000)
    assert noise.over(4_000, 4_000) != noise.over(8_000, 4_000)
    assert Noise({"force": 0.1}, 2).over(0, 4_000)[1:] == ((0.0,) * 3, (1.0,) * 8)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"noise": "forse=1"}, 'did you mean "force"'),
        ({"noise": {"motors": -1}}, "at least 0"),
        ({"noise": "force"}, "at least 0"),
        ({"window": "30:10"}, "BEGIN:END"),
        ({"window": "x"}, "BEGIN:END"),
        ({"window": (5, 9), "duration": 3}, "begins after the flight"),
    ],
)
def test_wrong_noise_and_windows_are_refused(options: dict[str, object], said: str) -> None:
    with pytest.raises(OptionError, match=said):
        FlightSpec.of("hover", **options)
