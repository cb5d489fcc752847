"""What sensors add to the truth: the statistics that their descriptions promise."""

from itertools import islice
from math import exp

import numpy as np
import pytest
from numpy.typing import NDArray

from colibri.plant.environment.random_streams import Chance, RandomStream, streams
from colibri.plant.sensors.instrument import GaussMarkov, Triad

INTERVAL_S = 0.01
ZERO = (0.0, 0.0, 0.0)


def chance(seed: int = 0) -> Chance:
    (stream,) = streams(seed, RandomStream.SENSORS, 1)
    return stream


def samples(triad: Triad, count: int) -> NDArray[np.float64]:
    return np.array([triad.measure(ZERO) for _ in range(count)])


def test_white_noise_has_its_density_at_every_interval() -> None:
    for interval_s in (0.001, 0.004, 0.05):
        noise = samples(Triad(0.3, 0.0, 0.0, 1e9, interval_s, chance()), 20_000)
        assert noise.std(axis=0) * interval_s**0.5 == pytest.approx(0.3, rel=0.02)
        assert noise.mean(axis=0) == pytest.approx(0.0, abs=4.0 * 0.3 / (20_000 * interval_s) ** 0.5)


def test_the_bias_begins_and_walks_as_described() -> None:
    turn_on, walk, steps = 2.0, 0.5, 100
    triads = [Triad(0.0, walk, turn_on, 1e9, INTERVAL_S, chance(seed)) for seed in range(1000)]
    began = np.array([triad.bias for triad in triads])
    walked = np.array([samples(triad, steps)[-1] for triad in triads]) - began
    assert began.std() == pytest.approx(turn_on, rel=0.05)
    assert walked.std() == pytest.approx(walk * (steps * INTERVAL_S) ** 0.5, rel=0.05)


def test_what_is_larger_than_the_range_is_cut() -> None:
    triad = Triad(0.0, 0.0, 0.0, 3.0, INTERVAL_S, chance())
    assert triad.measure((5.0, -5.0, 2.0)) == (3.0, -3.0, 2.0)


@pytest.mark.parametrize("elapsed_s", [1.0, 30.0, 200.0])
def test_a_drift_keeps_its_variance_and_forgets_in_its_time(elapsed_s: float) -> None:
    deviation, time_s = 1.5, 60.0
    drifts = [GaussMarkov(deviation, time_s, chance(seed)) for seed in range(3000)]
    before = np.array([drift.value for drift in drifts])
    after = np.array([drift.after(elapsed_s) for drift in drifts])
    assert before.std() == pytest.approx(deviation, rel=0.05)
    assert after.std() == pytest.approx(deviation, rel=0.05)
    assert np.mean(before * after) / deviation**2 == pytest.approx(exp(-elapsed_s / time_s), abs=0.06)


def test_streams_are_the_seeds_and_nobody_elses() -> None:
    def first(seed: int, source: RandomStream, count: int) -> list[list[float]]:
        return [list(islice(stream, 2000)) for stream in streams(seed, source, count)]

    assert first(7, RandomStream.SENSORS, 3) == first(7, RandomStream.SENSORS, 5)[:3]
    everything = [
        *first(7, RandomStream.SENSORS, 3),
        *first(8, RandomStream.SENSORS, 3),
        *first(7, RandomStream.WEATHER, 3),
    ]
    correlation = np.corrcoef(np.array(everything)) - np.eye(len(everything))
    assert np.abs(correlation).max() < 0.1
