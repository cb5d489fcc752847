"""Flights with faults of actuators and battery, with a payload, and of an autopilot that is slow or late."""

from collections.abc import Callable
from math import dist

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK, restart

pytestmark = QUICK

NOMINAL_KG, PAYLOAD_KG = 0.698, 0.15
CALM_HOVER = pytest.mark.sitl(airborne=5.0)


@CALM_HOVER
def test_the_autopilot_knows_of_a_sagging_battery(sitl: Sitl) -> None:
    sitl.run(1.0)
    assert sitl.gcs.latest("BATTERY_STATUS").battery_remaining >= 99
    sitl.inject("battery", "wrong", 0, 0.3)
    sitl.run(2.5)
    after = sitl.gcs.latest("BATTERY_STATUS")
    assert after.battery_remaining == pytest.approx(30, abs=1)
    capacity_ah = load_vehicle("hummingbird").battery.capacity_ah  # type: ignore[union-attr]
    assert sitl.inside.copter.parts.battery.charge_ah == pytest.approx(0.7 * capacity_ah, rel=0.03)
    told_v = sum(cell for cell in after.voltages if cell != 65535) / 1e3
    assert told_v == pytest.approx(sitl.inside.world.voltage_v, rel=0.03)
    assert sitl.position == pytest.approx((0.0, 0.0, 5.0), abs=0.1)
    restart(sitl, lambda _: None)
    sitl.run(0.6)
    assert sitl.inside.copter.parts.battery.charge_ah == pytest.approx(0.7 * capacity_ah, rel=0.03)


@pytest.mark.long
def test_a_slow_solver_acts_late_and_skips_samples(sitl_fleet: Callable[..., list[Sitl]]) -> None:
    def flown(solve_ms: float, off_m: float = 0.1) -> Sitl:
        (sitl,) = sitl_fleet(1, airborne=5.0, system=1, params={"SIM_SOLVE_MS": solve_ms})
        sitl.run(0.5)
        sitl.goto(2.0, 0.0, 5.0, wait=False)
        sitl.run(4.5)
        assert dist(sitl.position, (2.0, 0.0, 5.0)) < off_m
        return sitl

    prompt, in_time, late = flown(0.0), flown(8.0), flown(12.0, 0.3)
    missed = [sitl.inside.copter.parts.actuation.missed for sitl in (prompt, in_time, late)]
    assert missed[:2] == [0, 0]
    assert missed[2] == pytest.approx(5.0 / 0.016, rel=0.05)  # every second sample is skipped
    assert len({sitl.sha256 for sitl in (prompt, in_time, late)}) == 3
    assert flown(12.0, 0.3).sha256 == late.sha256  # it swings: half the rate, and late


# A payload that is picked up and dropped in flight: its mass is estimated, in the air alone.


def mass_kg(sitl: Sitl) -> float:
    decision = sitl.inside.copter.parts.actuation.decision
    assert decision is not None
    return decision.diagnostics.mass_kg


@CALM_HOVER
def test_a_payload_is_estimated_and_kept_over_a_restart(sitl: Sitl) -> None:
    sitl.payload_kg = PAYLOAD_KG
    sitl.run(8.0)
    assert 4.985 < sitl.path[:, 2].min() < 4.995
    assert sitl.position[2] == pytest.approx(5.0, abs=1e-4)
    learned_kg = mass_kg(sitl)
    assert learned_kg == pytest.approx(NOMINAL_KG + PAYLOAD_KG, rel=0.03)
    told = {message.name: message.value for message in sitl.heard("NAMED_VALUE_FLOAT")}
    assert told["mass_kg"] == pytest.approx(learned_kg, rel=0.01)
    sitl.inside.skip(30)
    restart(sitl)
    sitl.run(0.02)
    assert mass_kg(sitl) == pytest.approx(learned_kg, rel=0.01)


def test_the_ground_is_no_payload(sitl: Sitl) -> None:
    """Neither as it lets the vehicle go nor as it holds it; and each take-off begins with the nominal mass."""
    sitl.takeoff(1.5)
    sitl.run(1.0)
    assert mass_kg(sitl) == pytest.approx(NOMINAL_KG, rel=1e-3)
    sitl.payload_kg = PAYLOAD_KG
    sitl.run(3.0)
    sitl.payload_kg = 0.0
    sitl.land(wait=False)
    flown_kg = []
    ground = sitl.inside.copter.pilot.ground
    sitl.wait_until(lambda: flown_kg.append(mass_kg(sitl)) or ground.standing, within=10.0)  # type: ignore[func-returns-value]
    assert flown_kg[1] > 1.08 * NOMINAL_KG > flown_kg[-2] > NOMINAL_KG
    assert flown_kg[-2] == flown_kg[-60]
    sitl.run(0.05)
    sitl.takeoff(1.5)
    sitl.run(1.0)
    assert mass_kg(sitl) == pytest.approx(NOMINAL_KG, rel=1e-3)
    assert sitl.mode is Mode.HOLD


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.RETURN, Mode.TRACK, Mode.ALTITUDE])
@pytest.mark.sitl(airborne=3.0)
def test_a_fall_is_an_impact_in_any_mode(sitl: Sitl, mode: Mode) -> None:
    with sitl.sticks_held():
        sitl.select(mode)
        sitl.inject("motor", "off")
        sitl.wait_until(lambda: sitl.position[2] < 0.01, within=2.0)
        sitl.wait_until(lambda: not sitl.armed, within=1.0)
    assert sitl.said("Impact at 7")
    assert sitl.texts[-1] == "Disarmed by impact"
