"""What laws from elsewhere need: a rate loop below them, their rotor order and axes."""

from math import degrees
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.autopilot.control.parts.rotor_frame import LAYOUTS
from colibri.common.rotations import quaternion_from_euler, rotation_matrix
from colibri.plant.vehicle.description import load_vehicle


class Rates:
    control_interval_us = 10_000
    preview = colibri.Preview(interval_us=10_000, samples=1)

    def __init__(self, _settings: object, vehicle: colibri.Vehicle, _clock: object) -> None:
        self._loop = colibri.RateLoop(vehicle, 0.01)
        self._weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2

    def initial(self, _rotor_speed: float) -> Any:
        return self._loop.initial()

    def step(self, memory: Any, _time_us: int, state: colibri.VehicleState, references: Any) -> Any:
        off = references.position_enu_m[0] - state.position_enu_m
        pull = 2.0 * off + 2.5 * (references.velocity_enu_m_s[0] - state.velocity_enu_m_s)
        wanted = np.array([-pull[1], pull[0], 0.0]) / 9.81
        rates = 5.0 * (wanted - state.euler)
        memory, speeds = self._loop.step(memory, state, rates, self._weight_n * (1.0 + pull[2] / 9.81))
        return memory, colibri.Decision(speeds, tuple(wanted))


@pytest.mark.parametrize(
    ("name", "weak", "within_m"), [("hummingbird", 1.0, 0.01), ("hummingbird", 0.8, 0.08), ("iris", 0.9, 0.08)]
)
def test_a_law_of_rates_holds_a_point(name: str, weak: float, within_m: float) -> None:
    vehicle = load_vehicle(name).without(("battery",))
    plant = vehicle.replace("rotors.strength.0", weak) if weak < 1.0 else None
    options: dict[str, Any] = {"plant_vehicle": plant} if plant else {}
    start = {"x": 0.5, "z": 2.0, "psi": 0.0}
    flight = colibri.fly("hover", controller=Rates, vehicle=vehicle, link="direct", duration=8, start=start, **options)
    assert flight.lost is None
    assert abs(flight.samples["x"][-1]) < within_m
    assert abs(degrees(flight.samples["psi"][-1])) < 1.0


@pytest.mark.parametrize(
    ("name", "layout", "yaw_deg"),
    [
        ("hummingbird", "px4-+", 0.0),
        ("hummingbird", "px4-x", 45.0),
        ("hummingbird", "crazyflie-x", 45.0),
        ("hummingbird", "betaflight-x", 45.0),
        ("iris", "px4-x", 0.0),
        ("iris", "px4-+", -45.0),
        ("iris", "crazyflie-x", 0.0),
    ],
)
def test_rotors_and_axes_of_a_layout(name: str, layout: Any, yaw_deg: float) -> None:
    vehicle = load_vehicle(name)
    frame = colibri.RotorFrame(vehicle, layout)
    assert abs(frame.yaw_deg - yaw_deg) in (0.0, 90.0, 180.0)
    if layout == f"px4-{vehicle.rotors.numbering().shape}" and frame.yaw_deg == 0.0:
        assert tuple(frame.order) == vehicle.rotors.numbering().rotors
    attitude = quaternion_from_euler(0.3, -0.2, 1.0)
    state = colibri.VehicleState((0, 0, 0), (0, 0, 0), attitude, (0.3, -0.2, 1.0), (0.1, 0.2, 0.3))
    turned = frame.state(state._replace(rotor_speeds=(1.0, 2.0, 3.0, 4.0)))
    before, after = np.array(rotation_matrix(attitude)), np.array(rotation_matrix(turned.attitude))
    assert after @ turned.rate_flu_rad_s == pytest.approx(before @ state.rate_flu_rad_s)
    assert frame.to_vehicle(turned.rotor_speeds).tolist() == [1.0, 2.0, 3.0, 4.0]
    places = before @ np.array([[x, y, 0.0] for x, y, *_ in vehicle.rotors.position_m]).T
    bearing = np.radians(LAYOUTS[layout][0])
    seen = after @ np.array([np.cos(bearing), -np.sin(bearing), np.zeros(4)])
    along = (places[:, frame.order] * seen).sum(axis=0) / np.linalg.norm(places[:, frame.order], axis=0)
    assert along.min() > 0.9


def test_a_wrong_layout_is_one_line() -> None:
    with pytest.raises(colibri.Error, match='unknown layout "px4-y"'):
        colibri.RotorFrame(load_vehicle("iris"), "px4-y")  # type: ignore[arg-type]
    odd = load_vehicle("hummingbird").replace("rotors.position_m", [[0.2, 0.0], [0.1, -0.2], [-0.2, 0.0], [0.0, 0.2]])
    with pytest.raises(colibri.Error, match="are placed or turn differently"):
        colibri.RotorFrame(odd, "px4-x")
