"""Exceptions thrown into flights: a sample of `python -m tools.chaos`, which throws at many instants."""

from math import inf

import pytest

from colibri.mavlink.hil.feedback import Feedback
from colibri.sitl.vehicle import Sitl
from tools.chaos import SITUATIONS, ChaosFlight, Thrower, airborne


def flown(flight: Sitl, situation: str, place: str, times: float) -> tuple[str, str]:
    SITUATIONS[situation](flight)
    verdict = ChaosFlight(flight, situation, Thrower(place, times)).judged()
    return verdict.outcome, verdict.said


@pytest.mark.parametrize(
    ("place", "situation", "times", "outcome", "said"),
    [
        ("autopilot.control.loop:ControlLoop.decide", "hover", 1, "flown on", "control law failed: plain law flies"),
        (
            "autopilot.guidance.tasks.offboard:OffboardTask.update",
            "offboard",
            1,
            "flown on",
            "flight task failed: hold",
        ),
        ("autopilot.commander.pilot:Pilot.step", "hover", inf, "landed", "guidance failed: descending"),
        ("autopilot.commander.pilot:Pilot.sense", "landing", inf, "landed", "step failed: descending"),
        ("autopilot.ground.snapshots:SnapshotBuilder.take", "hover", inf, "flown on", "telemetry failed"),
        ("mavlink.services.command:CommandService.receive", "hover", inf, "flown on", "CommandService failed"),
        ("autopilot.commander.supervisor:Supervisor.step", "hover", inf, "flown on", "failsafes failed: none may act"),
    ],
)
@pytest.mark.sitl(airborne=3.0, strict=False)
def test_it_flies_on_or_lands(sitl: Sitl, place: str, situation: str, times: float, outcome: str, said: str) -> None:
    became, text = flown(sitl, situation, place, times)
    assert became == outcome
    assert text.startswith(said)


@pytest.mark.long
@pytest.mark.parametrize("times", [1, inf])
def test_without_an_estimator_it_flies_on_or_lands_blind(times: float) -> None:
    with airborne(Feedback.SENSORS) as flight:
        outcome, said = flown(flight, "hover", "autopilot.estimation.estimator:Estimator._take_in", times)
    assert outcome == ("flown on" if times == 1 else "landed")
    assert said == "estimator failed: inertial sensors carry on"
