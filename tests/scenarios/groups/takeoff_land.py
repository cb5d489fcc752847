"""Take-off and landing."""

from pathlib import Path

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words.conditions import (
    ARMED,
    DISARMED,
    above,
    below,
    climbs,
    every,
    height,
    mode,
    over,
    tilted_less,
    turns_slower,
)
from tests.scenarios.words.scenario import Scenario
from tests.scenarios.words.steps import (
    arm,
    check,
    goto,
    highest,
    hold,
    land,
    measured,
    put,
    run,
    select,
    takeoff,
    until,
)

UPDRAFT = Path(__file__).parent / "updraft.csv"


def believed_height_stays(sitl: Sitl) -> None:
    told = [message.z for message in sitl.heard("LOCAL_POSITION_NED")[-100:]]
    assert max(told) - min(told) <= 0.1


SCENARIOS = (
    Scenario(
        name="holds-ten-metres-for-a-minute",
        peer="PX4: 10 m ± 0.25 m for 60 s",
        holds="± 0.02 m for 60 s",
        steps=(takeoff(10.0), run(2.0), hold(height(10.0, 0.02), for_=60.0)),
    ),
    Scenario(
        name="holds-ten-metres-on-sensors",
        peer="PX4: 10 m ± 0.25 m for 60 s",
        holds="± 1 m for 60 s from the truth, ± 0.05 m by its own estimate",
        steps=(takeoff(10.0), run(2.0), hold(height(10.0, 1.0), for_=60.0), believed_height_stays),
        setting={"feedback": "sensors"},
    ),
    Scenario(
        name="guided-takeoff-does-not-overshoot",
        peer="AP: at most 5 m",
        holds="at most 0.05 m",
        steps=(takeoff(5.0), run(3.0), measured("the highest point", highest, 5.05)),
    ),
    Scenario(
        name="does-not-yaw-on-takeoff",
        peer="AP FlyEachFrame: below 20°/s",
        holds="below 1°/s and tilted less than 2°, all the way up",
        steps=(
            takeoff(5.0, wait=False),
            hold(every(turns_slower(1.0), tilted_less(2.0)), for_=8.0),
            check(height(5.0, 0.1)),
        ),
    ),
    Scenario(
        name="keeps-level-when-it-yaws",
        peer="AP FlyEachFrame: tilt at most 2° after yaw steps",
        holds="at most 2° during them, too",
        steps=(
            goto((0.0, 0.0, 5.0), yaw_deg=0.0, wait=False),
            hold(tilted_less(2.0), for_=4.0),
            goto((0.0, 0.0, 5.0), yaw_deg=180.0, wait=False),
            hold(tilted_less(2.0), for_=6.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="lands-at-its-speed",
        peer="AP: ± 0.1 m/s for 5 s",
        holds="0.2 ± 0.02 m/s for 4 s",
        steps=(
            put("MPC_LAND_SPEED", 0.2),
            land(wait=False),
            until(below(1.0), within=10.0),
            run(0.3),
            hold(climbs(-0.2, 0.02), for_=4.0),
            until(DISARMED, within=10.0),
        ),
        setting={"airborne": 2.5},
    ),
    Scenario(
        name="lands-where-it-took-off",
        peer="AP: at most 2 m away, measured 1.1 to 1.3 m",
        holds="at most 0.05 m",
        steps=(takeoff(8.0), land(), check(every(DISARMED, over(0.0, 0.0, 0.05)))),
    ),
    Scenario(
        name="lands-where-it-took-off-on-sensors-in-wind",
        peer="AP: at most 2 m away",
        holds="at most 1.5 m",
        steps=(takeoff(8.0), land(), check(every(DISARMED, over(0.0, 0.0, 1.5)))),
        setting={"feedback": "sensors", "wind": "5@270", "turbulence": "light"},
        seeds=(1, 2, 3),
    ),
    Scenario(
        name="returns-and-lands-at-home",
        peer="AP: at most 1 m high and 10 m from home when it disarms, within 250 s",
        holds="0.1 m from home, within 60 s",
        steps=(
            put("RTL_RETURN_ALT", 15.0),
            takeoff(5.0),
            goto((30.0, 20.0, 8.0)),
            select(Mode.RETURN),
            until(above(14.5), within=15.0),
            until(DISARMED, within=60.0),
            check(every(over(0.0, 0.0, 0.1), height(0.0, 0.2))),
        ),
    ),
    Scenario(
        name="no-landing-is-detected-in-an-updraft",
        peer="AP AirModeLanding: none within 2 s",
        holds="none while air that rises with 3 m/s carries it, and it lands",
        steps=(
            land(wait=False),
            hold(every(ARMED, mode(Mode.LAND)), for_=4.0),
            until(DISARMED, within=20.0),
            check(height(0.0, 0.1)),
        ),
        setting={"airborne": 5.0, "wind": str(UPDRAFT)},
    ),
    Scenario(
        name="taking-off-without-arming-stays",
        peer="ours",
        holds="a mode that is chosen on the ground turns no rotor",
        steps=(
            select(Mode.TAKEOFF),
            hold(every(DISARMED, height(0.0, 0.01)), for_=2.0),
            arm(),
            until(ARMED, within=0.1),
        ),
    ),
)
