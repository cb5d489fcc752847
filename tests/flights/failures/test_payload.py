"""A payload that is picked up and dropped in flight: its mass is learned, in the air alone, and kept over a restart."""

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.hil.world_changes import PayloadChange
from tools.harness.copter_flight import ACCEPTED, CopterFlight, in_the_air

NOMINAL_KG = 0.698
PAYLOAD_KG = 0.15


def mass_kg(flight: CopterFlight) -> float:
    """Return the mass that the control law has learned."""
    decision = flight.copter.parts.actuation.decision
    assert decision is not None
    return decision.diagnostics.mass_kg


def carry(flight: CopterFlight, payload_kg: float) -> None:
    flight.plant.inject([PayloadChange(payload_kg)])


def test_a_payload_is_learned_in_hover_told_and_kept_over_a_restart() -> None:
    flight = in_the_air()
    carry(flight, PAYLOAD_KG)
    heights_m = [z for _, _, z in flight.path(8.0)]
    assert 4.985 < min(heights_m) < 4.995
    assert heights_m[-1] == pytest.approx(5.0, abs=1e-4)
    learned_kg = mass_kg(flight)
    assert learned_kg == pytest.approx(NOMINAL_KG + PAYLOAD_KG, rel=0.03)
    told = {message.name: message.value for message in flight.client.heard["NAMED_VALUE_FLOAT"]}
    assert told["mass_kg"] == pytest.approx(learned_kg, rel=0.01)
    past = flight.history()
    flight.skip(30)
    flight.restart(past)
    assert mass_kg(flight) == pytest.approx(learned_kg, rel=0.01)


def test_the_ground_is_no_payload() -> None:
    """Neither as it lets the vehicle go nor as it holds it; and each take-off begins with the nominal mass."""
    flight = CopterFlight()
    flight.takeoff(1.5)
    assert mass_kg(flight) == pytest.approx(NOMINAL_KG, rel=1e-3)
    carry(flight, PAYLOAD_KG)
    flight.run(3.0)
    carry(flight, 0.0)
    assert flight.select(Mode.LAND) == ACCEPTED
    flown_kg = []
    while not flight.copter.pilot.ground.standing:
        flown_kg.append(mass_kg(flight))
        flight.step()
    assert flown_kg[0] > 1.08 * NOMINAL_KG > flown_kg[-1] > NOMINAL_KG
    assert flown_kg[-1] == flown_kg[-60]
    flight.takeoff(1.5)
    assert mass_kg(flight) == pytest.approx(NOMINAL_KG, rel=1e-3)
