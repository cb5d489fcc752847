"""Links and processes: what they lose, spoil, delay; what dies; and what else there is on them."""

from collections.abc import Sequence
from dataclasses import replace

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.vehicle import Sitl
from tests.scenarios.groups import holding, missions, offboard, takeoff_land
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import FleetScenario, Scenario

PLACE = (0.0, 0.0, 5.0)
ROUGH = {"loss": 0.3, "jitter_s": 0.05}
COMMANDED = {
    scenario.name: scenario
    for group in (takeoff_land, holding, missions, offboard)
    for scenario in group.SCENARIOS
    if isinstance(scenario, Scenario)
}
OVER_A_ROUGH_LINK = (
    "lands-where-it-took-off",
    "returns-and-lands-at-home",
    "goto",
    "pause-and-resume",
    "mission-outside-the-fence",
    "mode-change-during-upload",
)


def unlike(sitls: Sequence[Sitl]) -> None:
    """Fly the same with a plant link that is perfect, and with one that is not."""
    good, bad = sitls
    for name, value in {"loss": 0.2, "duplicate": 0.1, "reorder": 0.1, "corrupt": 0.05}.items():
        setattr(bad.link.plant, name, value)
    for sitl in sitls:
        sitl.fleet = ()  # one after the other, each in its own time
        sitl.goto(4.0, 2.0, 6.0)
    assert good.sha256 == bad.sha256


def hears_spoiled(sitl: Sitl) -> None:
    dropped = sum(sitl.gcs.dropped.values())
    assert dropped > 20
    assert sum(sitl.gcs.counts.values()) > 3 * dropped


def many_listen(sitl: Sitl) -> None:
    stations = [sitl.gcs, sitl.client(252), sitl.client(253, 25)]
    sitl.run(2.0)
    before = [station.counts["HEARTBEAT"] for station in stations]
    sitl.run(30.0)
    assert all(station.counts["HEARTBEAT"] - was >= 30 for station, was in zip(stations, before, strict=True))


def is_not_moved(sitl: Sitl) -> None:
    sitl.send("COMMAND_LONG", 77, 1, mav.MAV_CMD_NAV_LAND, 0, *[0.0] * 7)
    sitl.send("SET_MODE", 77, 1, 0)
    sitl.run(1.0)


@do.word
def lands_after(sitl: Sitl, kills: int, every_s: float) -> None:
    for _ in range(kills):
        sitl.run(every_s)
        sitl.kill_autopilot()
    sitl.wait_until(lambda: not sitl.armed, within=80.0, what="the end of the mission")


SCENARIOS: tuple[Scenario | FleetScenario, ...] = (
    FleetScenario(
        name="the-plant-link-cannot-change-a-flight",
        peer="ours: the same trajectory in lockstep",
        holds="20 % lost, 10 % duplicated, 10 % late, 5 % corrupt: the same hash",
        count=2,
        fly=unlike,
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="corrupted-frames",
        peer="ours: dropped by checksum, counted",
        holds="10 % of the ground link: all dropped, the vehicle stays",
        steps=(do.trouble("ground", corrupt=0.1), do.run(10.0), hears_spoiled, do.check(see.near(PLACE, 0.01))),
        setting={"airborne": 5.0},
    ),
    *(
        replace(
            COMMANDED[name],
            name=f"{name}-over-a-rough-link",
            peer="ours: 30 % lost and 50 ms of jitter, each way",
            holds="as on a good link",
            steps=(do.trouble("ground", **ROUGH), *COMMANDED[name].steps),
        )
        for name in OVER_A_ROUGH_LINK
    ),
    Scenario(
        name="autopilot-killed-in-hover",
        peer="ours: at most 2 m lost, at most 45° more tilt than the limit",
        holds="at most 0.05 m and 5°, holds",
        steps=(
            do.run(2.0),
            *(do.kill_autopilot, do.run(2.0)) * 2,
            do.measured("the distance", do.max_distance_from(PLACE), 0.05),
            do.check(see.every(see.ARMED, see.mode(Mode.HOLD), see.tilted_less(5.0))),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="autopilot-killed-on-a-mission",
        peer="ours: the mission ends",
        holds="killed five times: ends at its last item",
        steps=(
            *missions.ALONG_THE_CORRIDOR,
            lands_after(5, 6.0),
            do.measured("the distance from the square", missions.off_the_square, 1.2),
            do.check(see.over(0.0, 0.0, 0.2)),
        ),
    ),
    Scenario(
        name="autopilot-killed-on-a-mission-on-sensors",
        peer="ours: the mission ends",
        holds="killed three times: lands within 3 m of its last item",
        steps=(
            *missions.ALONG_THE_CORRIDOR,
            lands_after(3, 9.0),
            do.check(see.every(see.DISARMED, see.over(0.0, 0.0, 3.0))),
        ),
        setting={"feedback": "sensors", "seed": 3},
    ),
    Scenario(
        name="more-ground-stations-keep-their-heartbeats",
        peer="AP: two more, 30 s",
        holds="30 in 30 s for each of three",
        steps=(many_listen,),
        calm="counts heartbeats",
    ),
    Scenario(
        name="messages-for-other-systems",
        peer="ours",
        holds="stays within 0.01 m",
        steps=(is_not_moved, do.hold(see.every(see.near(PLACE, 0.01), see.mode(Mode.HOLD)), for_=1.0)),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="a-slow-solver",
        peer="ours: the declared solve time delays the rotors",
        holds="solve time 7 ms, sample 8 ms: within 0.05 m of a 3 m step after 8 s",
        steps=(
            do.put("SIM_SOLVE_MS", 7.0),
            do.goto((3.0, 0.0, 5.0), wait=False),
            do.until(see.near((3.0, 0.0, 5.0), 0.05), within=8.0),
            do.hold(see.every(see.near((3.0, 0.0, 5.0), 0.1), see.tilted_less(10.0)), for_=3.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="late-ground-link",
        peer="ours",
        holds="0.5 s each way: flies there and back",
        steps=(
            do.trouble("ground", delay_s=0.5),
            do.goto((3.0, 0.0, 5.0)),
            do.goto((0.0, 0.0, 5.0)),
            do.check(see.every(see.near(PLACE, 0.3), see.above(4.7))),
        ),
        setting={"airborne": 5.0},
    ),
)
