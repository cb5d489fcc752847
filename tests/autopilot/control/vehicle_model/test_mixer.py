"""The allocation of more than four rotors: exact within limits, by priority beyond, and which yaw remains."""

import msgspec
import numpy as np
import pytest

from colibri.autopilot.control.parts.level import levelled
from colibri.autopilot.control.vehicle_model.mixer import allocate, exact_inverse, holds_yaw, mixing_of
from colibri.plant.vehicle.description import Vehicle, load_vehicle

FIREFLY, X8 = load_vehicle("firefly"), load_vehicle("x8")
TILTED = tuple((0.1 * (i % 3), -0.15 * (i % 2), 1.0) for i in range(6))
ODD = msgspec.structs.replace(
    FIREFLY,
    rotors=msgspec.structs.replace(FIREFLY.rotors, axis=TILTED),
    body=msgspec.structs.replace(
        FIREFLY.body,
        inertia_kg_m2=(0.04, 0.05, 0.07),
        inertia_products_kg_m2=(0.004, -0.003, 0.002),
        center_of_mass_m=(0.02, -0.01, 0.03),
    ),
)


def whole(vehicle: Vehicle) -> np.ndarray:
    return vehicle.allocation() * vehicle.rotors.max_speed**2


@pytest.mark.parametrize("vehicle", [FIREFLY, X8, ODD])
def test_what_rotors_can_set_is_set_exactly(vehicle: Vehicle) -> None:
    allocation, rng = whole(vehicle), np.random.default_rng(1)
    mixing, beyond = mixing_of(allocation), 0
    for _ in range(50):
        wrench = allocation @ rng.beta(0.4, 0.4, vehicle.rotors.count)
        squared = allocate(wrench, mixing, 0.0, 1.0)
        free = exact_inverse(allocation) @ wrench
        beyond += free.min() < 0.0 or free.max() > 1.0
        assert squared.min() >= 0.0
        assert squared.max() <= 1.0
        missed = np.abs(allocation @ squared - wrench) / np.abs(allocation).sum(axis=1)
        assert missed.max() < 0.02
    assert beyond > 5  # only the null space keeps these within limits


def test_too_much_is_given_up_in_order_of_priority() -> None:
    allocation = whole(FIREFLY)
    most = np.abs(allocation).sum(axis=1)
    wrench = np.array([0.5 * most[0], 0.2 * most[1], -0.2 * most[2], 2.0 * most[3]])
    flown = allocation @ allocate(wrench, mixing_of(allocation), 0.0, 1.0)
    assert flown[1:3] == pytest.approx(wrench[1:3], rel=0.02)
    assert flown[0] == pytest.approx(wrench[0], rel=0.05)
    assert 0.0 < flown[3] < wrench[3]


@pytest.mark.parametrize(
    ("vehicle", "holds"),
    [
        (FIREFLY, True),
        (FIREFLY.without_rotor(2), False),  # rank 4, but the opposite rotor cannot pull
        (X8.without_rotor(5), True),
        (load_vehicle("y6").without_rotor(0), True),
    ],
)
def test_yaw_is_held_if_rotors_can_turn_both_ways(vehicle: Vehicle, holds: bool) -> None:
    assert holds_yaw(vehicle) is holds


def test_a_tilted_vehicle_hovers_level_in_its_own_frame() -> None:
    vehicle, to_body = levelled(ODD)
    assert to_body is not None
    force = vehicle.wrenches() @ exact_inverse(vehicle.allocation())[:, 0]
    assert force == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], abs=1e-6)
    assert np.linalg.eigvalsh(vehicle.body.inertia()) == pytest.approx(np.linalg.eigvalsh(ODD.body.inertia()))
    assert levelled(FIREFLY) == (FIREFLY, None)
