"""The integrators: order, agreement, what they do with a state that explodes, and that nobody compiles twice."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from colibri.common.jit import packed
from colibri.common.types import Array
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.equations import close_attitude
from colibri.plant.physics.integrators import Integrator, adaptive_step, fixed_step, runge_kutta_4
from colibri.plant.physics.start import IntegrationError, Start
from colibri.plant.physics.world import Physics, World, parameters_of
from colibri.plant.vehicle.description import load_vehicle
from tests.support.plant_flights import command, flight, hummingbird, states

UNEVEN = (480.0, 500.0, 510.0, 495.0)
PARAMETERS = packed(parameters_of(hummingbird("drag", "rotor-lag"), (1.0, -2.0, 0.0)))
CACHED = """
from colibri.plant.physics.frames import adaptive_frames, fixed_frames
from colibri.plant.vehicle.description import load_vehicle
from colibri.plant.physics.world import Physics
for name, kernel in (("rk4", fixed_frames), ("adaptive", adaptive_frames)):
    Physics(load_vehicle("hummingbird"), name)
    print(sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))
"""


def tumbling() -> Array:
    return np.array([3.0, -2.0, 1.0, 4.0, -5.0, 3.0, 0.0, 0.0, 50.0, 1.0, 0.0, 0.0, 0.0, *UNEVEN, 0.0])


def by_runge_kutta_4(duration_s: float, steps: int) -> Array:
    end = np.empty(18)
    runge_kutta_4(tumbling(), UNEVEN, PARAMETERS, duration_s, steps, end)
    return end


def test_runge_kutta_is_of_fourth_order() -> None:
    adaptive_step(tumbling(), UNEVEN, PARAMETERS, 0.4, exact := np.empty(18))
    counts = (16, 32, 64)
    errors = [float(np.abs(by_runge_kutta_4(0.4, steps) - exact)[:13].max()) for steps in counts]
    assert np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(-4.0, abs=0.3)


@pytest.mark.parametrize("duration_s", [0.004, 0.1, 0.0014])
def test_no_step_is_longer_than_a_millisecond(duration_s: float) -> None:
    steps = {0.004: 4, 0.1: 100, 0.0014: 2}[duration_s]
    expected = by_runge_kutta_4(duration_s, steps)
    fixed_step(tumbling(), UNEVEN, PARAMETERS, duration_s, end := np.empty(18))
    assert close_attitude(expected)
    assert (end == expected).all()


def test_both_agree_in_free_flight_with_lag_drag_and_battery() -> None:
    vehicle = hummingbird("drag", "rotor-lag", "battery")
    start = Start(z=50.0, phi=20.0, vx=3.0, p=4.0, q=-3.0, r=2.0, rotors=3000.0)
    order = command(*UNEVEN, vehicle=vehicle)
    ends = [flight(vehicle, start, order, 0.4, integrator=name, wind=(2.0, 1.0, 0.0))[-1] for name in BOTH]
    assert ends[0].state == pytest.approx(ends[1].state, abs=1e-7)
    assert ends[0].rotor_speeds == pytest.approx(ends[1].rotor_speeds, rel=1e-7)
    assert ends[0].charge_used_ah == pytest.approx(ends[1].charge_used_ah, rel=1e-7)
    assert ends[0].voltage_v == pytest.approx(ends[1].voltage_v, rel=1e-7)


@pytest.mark.parametrize("name", ["rk4", "adaptive"])
def test_a_state_that_explodes_is_an_error(name: Integrator) -> None:
    vehicle = load_vehicle("hummingbird")
    spinning = (*(0.0,) * 3, 1e200, 1e200, 1e200, *(0.0,) * 3, 1.0, *(0.0,) * 3)
    with pytest.raises(IntegrationError, match="the state left the range of the model"):
        Physics(vehicle, name).step(World(0, spinning, (0.0,) * 4), ActuatorCommand(0, (0.0,) * 4, True), 100_000)


def test_the_second_process_compiles_nothing() -> None:
    runs = [subprocess.run([sys.executable, "-c", CACHED], capture_output=True, text=True, check=True) for _ in "12"]
    assert runs[1].stdout.split("\n")[:2] == ["1 0", "1 0"]


@pytest.mark.parametrize("name", ["rk4", "adaptive"])
def test_frames_follow_each_other(name: Integrator) -> None:
    vehicle = hummingbird("drag", "rotor-lag")
    order = command(*UNEVEN, vehicle=vehicle)
    short = flight(vehicle, Start(z=9.0, p=1.0), order, 0.1, integrator=name, frame_us=4000)
    long = flight(vehicle, Start(z=9.0, p=1.0), order, 0.1, integrator=name, frame_us=100_000)
    assert all(after.time_us - before.time_us == 4000 for before, after in pairwise(short))
    assert states(short)[-1] == pytest.approx(states(long)[-1], abs=1e-8)


BOTH: tuple[Integrator, Integrator] = ("rk4", "adaptive")
