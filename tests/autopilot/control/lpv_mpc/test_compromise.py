"""Profile `agile`, thrown: it turns, brakes and climbs back."""

import numpy as np
import pytest

import colibri


@pytest.mark.parametrize("vehicle", ["hummingbird", "x500"])
@pytest.mark.parametrize(
    "turned",
    [{"phi": 20.0, "p": 5.0}, {"phi": 150.0, "p": -6.0, "q": 8.0}, {"theta": 80.0, "psi": 120.0, "q": -10.0, "r": 3.0}],
    ids=["level", "inverted", "on-edge"],
)
def test_a_thrown_vehicle_comes_back(vehicle: str, turned: dict[str, float]) -> None:
    start = {"x": 0.0, "y": 0.0, "z": 60.0, "vx": 20.0, "psi": 0.0, **turned}
    flight = colibri.fly("hover:height=60", profile="agile", vehicle=vehicle, link="direct", duration=8.0, start=start)
    z = np.array(flight.samples["z"])
    assert 60.0 - z.min() < 12.0
    assert abs(z[-1] - 60.0) < 0.5
    assert np.hypot(flight.samples["x"][-1], flight.samples["y"][-1]) < 1.0
