"""Fleets: several vehicles that do not see one another."""

from collections.abc import Sequence
from math import nan

from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from colibri.sitl.session import Fleet
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words.scenario import FleetScenario


def alone_and_together(sitls: Sequence[Sitl]) -> None:
    *together, alone = sitls
    alone.fleet = ()
    for flight in (Fleet(together), (alone,)):
        for sitl in flight:  # ordered at one instant
            vehicle = (sitl.system, AUTOPILOT_COMPONENT)
            sitl.send("COMMAND_LONG", *vehicle, mav.MAV_CMD_NAV_TAKEOFF, 0, 0.0, 0.0, 0.0, nan, nan, nan, 3.0)
            sitl.send("COMMAND_LONG", *vehicle, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *[0.0] * 6)
        flight[0].run(8.0)
        assert flight[0].is_at((0.0, 0.0, 3.0))
    assert {sitl.sha256 for sitl in sitls} == {alone.sha256}


def each_hears_its_own(sitls: Sequence[Sitl]) -> None:
    for number, sitl in enumerate(sitls):
        sitl.takeoff(2.0 + number)
    assert len({sitl.time_us for sitl in sitls}) == 1
    for number, sitl in enumerate(sitls):
        assert abs(sitl.position[2] - 2.0 - number) < 0.3
        assert {heartbeat.autopilot for heartbeat in sitl.heard("HEARTBEAT")} == {12}
    assert len({sitl.sha256 for sitl in sitls}) == len(sitls)
    assert sorted(sitl.system for sitl in sitls) == [1, 2, 3]


SCENARIOS = (
    FleetScenario(
        name="fleet-equals-solo",
        peer="ours: each trajectory equals its solo run",
        holds="three in a fleet, one alone: the same hash",
        count=4,
        fly=alone_and_together,
    ),
    FleetScenario(
        name="fleet-commands-are-separate",
        peer="ours: separate ports",
        holds="three take off to different heights",
        count=3,
        fly=each_hears_its_own,
    ),
)
