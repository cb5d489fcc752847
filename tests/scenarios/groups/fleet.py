"""Fleets: several vehicles that do not see one another."""

from collections.abc import Sequence

from colibri.sitl.vehicle import Sitl
from tests.scenarios.words.scenario import FleetScenario


def alone_and_together(sitls: Sequence[Sitl]) -> None:
    """Fly all side by side, the first by itself at the end: the same."""
    *together, alone = sitls
    for sitl in together:
        sitl.takeoff(3.0, wait=False)
    for _ in range(2000):
        for sitl in together:
            sitl.step()
    alone.takeoff(3.0, wait=False)
    while alone.time_us < together[0].time_us:
        alone.step()
    assert {sitl.sha256 for sitl in together} == {alone.sha256}


def each_hears_its_own(sitls: Sequence[Sitl]) -> None:
    """Give each another order."""
    for number, sitl in enumerate(sitls):
        sitl.takeoff(2.0 + number)
    for number, sitl in enumerate(sitls):
        assert abs(sitl.position[2] - 2.0 - number) < 0.3
        assert {heartbeat.autopilot for heartbeat in sitl.heard("HEARTBEAT")} == {12}
    assert len({sitl.sha256 for sitl in sitls}) == len(sitls)
    assert sorted(sitl.system for sitl in sitls) == [1, 2, 3]


SCENARIOS = (
    FleetScenario(
        name="together-as-alone",
        peer="ours: each trajectory equals its solo run",
        holds="three side by side, one alone: one hash",
        count=4,
        fly=alone_and_together,
    ),
    FleetScenario(
        name="each-hears-its-own-orders",
        peer="ours: disjoint ports",
        holds="three take off to heights of their own",
        count=3,
        fly=each_hears_its_own,
    ),
)
