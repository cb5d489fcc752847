"""The plant's fixed step and a ground that is too hard for it."""

from math import nextafter

import pytest
from msgspec.structs import replace

from colibri.plant.physics.contact import check_contact
from colibri.plant.physics.start import Start, check_start
from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle

VEHICLE = load_vehicle("hummingbird")


def with_ground(**values: float) -> Vehicle:
    assert VEHICLE.ground is not None
    return replace(VEHICLE, ground=replace(VEHICLE.ground, **values))


def with_arm(arm_m: float) -> Vehicle:
    rotors = replace(VEHICLE.rotors, position_m=((arm_m, 0.0), (0.0, -arm_m), (-arm_m, 0.0), (0.0, arm_m)))
    return replace(VEHICLE, rotors=rotors)


def most(said: str, key: str) -> float:
    return float(said.partition(f"{key} ")[2].partition("at most ")[2].partition(",")[0])


@pytest.mark.parametrize(
    ("key", "value"), [("stiffness_n_m", 1e7), ("damping_n_s_m", 1e4), ("slip_damping_n_s_m", 1e4)]
)
def test_the_key_is_named_with_the_largest_value_that_would_do(key: str, value: float) -> None:
    with pytest.raises(VehicleError, match=rf"^ground\.{key} \S+ is too large, at most ") as error:
        check_contact(with_ground(**{key: value}))
    largest = most(str(error.value), key)
    check_contact(with_ground(**{key: largest}))
    with pytest.raises(VehicleError):
        check_contact(with_ground(**{key: nextafter(1.02 * largest, value)}))


def test_long_arms_ask_for_a_softer_ground() -> None:
    with pytest.raises(VehicleError, match=r"with feet and rotors 0\.25 m from the centre and this inertia") as error:
        check_start(Start(z=2.0), with_arm(0.25))
    said = str(error.value)
    vehicle = with_arm(0.25)
    assert vehicle.ground is not None
    keys = ("damping_n_s_m", "slip_damping_n_s_m")
    softer = replace(vehicle.ground, **{key: most(said, f"ground.{key}") for key in keys})
    check_contact(replace(vehicle, ground=softer))
    assert "--without ground" in said
    check_start(Start(z=2.0), vehicle.without(["ground"]))
