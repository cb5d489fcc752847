"""A companion flies stand-ins for PX4 and ArduPilot, whose response and hover thrust it does not quite know."""

from collections.abc import Callable

import numpy as np
import pytest

from colibri.companion.identification import identified
from colibri.companion.settings import CompanionSettings
from tests.colibri.companion.in_memory import Ride
from tests.colibri.companion.stand_in import (
    GUIDED,
    LOITER,
    PX4_HOLD,
    PX4_OFFBOARD,
    STABILIZE,
    ArduPilot,
    Numbers,
    Px4,
    StandIn,
)


def test_it_flies_a_track() -> None:
    vehicle = ArduPilot()
    ride = Ride(vehicle, "spiral", CompanionSettings(may_arm=True, duration_s=5.0))
    assert ride.to_the_end(60.0).in_order
    errors = ride.companion.errors
    assert vehicle.mode == vehicle.hold
    assert [mode for _, mode in vehicle.modes] == [GUIDED, LOITER]
    assert errors.flown_s == pytest.approx(5.0, abs=0.1)
    assert errors.rmse_m() < 0.05


@pytest.mark.long
@pytest.mark.parametrize(
    "numbers",
    [
        Numbers(natural_rad_s=20.0, damping=0.5, late_s=0.06),
        Numbers(lag_s=(0.11, 0.11, 0.3), late_s=0.04),
        Numbers(natural_rad_s=20.0, damping=0.5, late_s=0.02),
        Numbers(natural_rad_s=18.0, damping=0.6, late_s=0.04),
        Numbers(lag_s=(0.028, 0.028, 0.3), late_s=0.055),
    ],
)
def test_px4_s_rates_may_follow_late_and_overshoot(numbers: Numbers) -> None:
    vehicle = Px4(numbers=numbers)
    ride = Ride(vehicle, "spiral", CompanionSettings(may_arm=True, duration_s=6.0)).flying(30.0)
    turning = []
    while ride.companion.ended is None:
        ride.step()
        turning.append(float(np.abs(vehicle.rate[:2]).max()))
    assert ride.companion.ended.in_order, ride.companion.ended.why
    assert vehicle.modes[-1][1] == PX4_HOLD
    (offboard_us,) = [at_us for at_us, mode in vehicle.modes if mode == PX4_OFFBOARD]
    assert len([at_us for at_us, _ in vehicle.setpoints if at_us <= offboard_us]) >= 100
    assert ride.companion.errors.flown_s == pytest.approx(6.0, abs=0.1)
    assert ride.companion.errors.rmse_m() <= 0.033
    assert max(turning[-500:]) < max(turning[:2000])


@pytest.mark.long
@pytest.mark.parametrize("made", [Px4, ArduPilot])
def test_the_hover_thrust_is_refined_in_flight(made: Callable[[], StandIn]) -> None:
    vehicle = made()
    ride = Ride(vehicle, "hover:height=2", CompanionSettings(may_arm=True, duration_s=14.0))
    ride.to_the_end(60.0)
    thrust = ride.companion.rows[-1].thrust
    assert thrust < 0.9
    load = (vehicle._signal(thrust) / vehicle.numbers.hover_signal) ** 2  # noqa: SLF001
    assert load == pytest.approx(1.0, abs=0.05)
    assert abs(ride.companion.thrust_scale - 1.0) > 0.03
    assert abs(ride.companion.rows[-1].push_z) < 0.25


@pytest.mark.parametrize(("made", "choice"), [(Px4, 7 << 16), (ArduPilot, STABILIZE)])
def test_a_pilot_s_mode_is_obeyed_within_a_tenth_of_a_second(made: Callable[[], StandIn], choice: int) -> None:
    vehicle = made()
    ride = Ride(vehicle, "hover:height=2", CompanionSettings(may_arm=True)).flying(30.0)
    vehicle.choose(choice)
    chosen_us, orders = ride.now_us, len(vehicle.modes)
    ride.to_the_end(1.0)
    assert ride.now_us - chosen_us <= 100_000
    for _ in range(300):
        ride.step()
    assert len(vehicle.modes) == orders


def test_an_ardupilot_taking_climb_rates_is_refused() -> None:
    vehicle = ArduPilot()
    vehicle.params["GUID_OPTIONS"] = 0
    ride = Ride(vehicle, "hover:height=2", CompanionSettings(may_arm=True, gives_up_s=6.0))
    assert "add 8 to GUID_OPTIONS" in ride.to_the_end(20.0).why
    assert not vehicle.armed


@pytest.mark.long
@pytest.mark.parametrize("made", [Px4, ArduPilot])
def test_an_identification_finds_what_the_stand_in_has(made: Callable[[], StandIn]) -> None:
    vehicle = made()
    ride = Ride(vehicle, "hover:height=2", CompanionSettings(may_arm=True, identifies=True))
    ride.to_the_end(60.0)
    response, _, _ = identified(ride.companion)
    assert response.time_constant_s == pytest.approx(vehicle.numbers.lag_s, rel=0.1)
    assert response.latency_s == pytest.approx(vehicle.numbers.late_s, abs=0.006)
