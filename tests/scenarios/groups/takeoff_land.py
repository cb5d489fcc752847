"""Take-off and landing."""

from pathlib import Path

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario

UPDRAFT = Path(__file__).parent / "updraft.csv"


def believed_height_stays(sitl: Sitl) -> None:
    told = [message.z for message in sitl.heard("LOCAL_POSITION_NED")[-100:]]
    assert max(told) - min(told) <= 0.1


SCENARIOS = (
    Scenario(
        name="holds-ten-metres-for-a-minute",
        peer="PX4: 10 m ± 0.25 m for 60 s",
        holds="± 0.02 m for 60 s",
        steps=(do.takeoff(10.0), do.run(2.0), do.hold(see.height(10.0, 0.02), for_=60.0)),
    ),
    Scenario(
        name="holds-ten-metres-on-sensors",
        peer="PX4: 10 m ± 0.25 m for 60 s",
        holds="± 1 m for 60 s from the truth, ± 0.05 m by its own estimate",
        steps=(do.takeoff(10.0), do.run(2.0), do.hold(see.height(10.0, 1.0), for_=60.0), believed_height_stays),
        setting={"feedback": "sensors"},
    ),
    Scenario(
        name="guided-takeoff-does-not-overshoot",
        peer="AP: at most 5 m",
        holds="at most 0.05 m",
        steps=(do.takeoff(5.0), do.run(3.0), do.measured("the highest point", do.highest, 5.05)),
    ),
    Scenario(
        name="does-not-yaw-on-takeoff",
        peer="AP FlyEachFrame: below 20°/s",
        holds="below 1°/s and tilted less than 2°, all the way up",
        steps=(
            do.takeoff(5.0, wait=False),
            do.hold(see.every(see.turns_slower(1.0), see.tilted_less(2.0)), for_=8.0),
            do.check(see.height(5.0, 0.1)),
        ),
    ),
    Scenario(
        name="keeps-level-when-it-yaws",
        peer="AP FlyEachFrame: tilt at most 2° after yaw steps",
        holds="at most 2° during yaw steps, too",
        steps=(
            do.goto((0.0, 0.0, 5.0), yaw_deg=0.0, wait=False),
            do.hold(see.tilted_less(2.0), for_=4.0),
            do.goto((0.0, 0.0, 5.0), yaw_deg=180.0, wait=False),
            do.hold(see.tilted_less(2.0), for_=6.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="lands-at-its-speed",
        peer="AP: ± 0.1 m/s for 5 s",
        holds="0.2 ± 0.02 m/s for 4 s",
        steps=(
            do.put("MPC_LAND_SPEED", 0.2),
            do.land(wait=False),
            do.until(see.below(1.0), within=10.0),
            do.run(0.3),
            do.hold(see.climbs(-0.2, 0.02), for_=4.0),
            do.until(see.DISARMED, within=10.0),
        ),
        setting={"airborne": 2.5},
    ),
    Scenario(
        name="lands-where-it-took-off",
        peer="AP: at most 2 m away, measured 1.1 to 1.3 m",
        holds="at most 0.05 m",
        steps=(do.takeoff(8.0), do.land(), do.check(see.every(see.DISARMED, see.over(0.0, 0.0, 0.05)))),
    ),
    Scenario(
        name="lands-where-it-took-off-on-sensors-in-wind",
        peer="AP: at most 2 m away",
        holds="at most 1.5 m",
        steps=(do.takeoff(8.0), do.land(), do.check(see.every(see.DISARMED, see.over(0.0, 0.0, 1.5)))),
        setting={"feedback": "sensors", "wind": "5@270", "turbulence": "light"},
        seeds=(1, 2, 3),
    ),
    Scenario(
        name="returns-and-lands-at-home",
        peer="AP: at most 1 m high and 10 m from home when it disarms, within 250 s",
        holds="0.1 m from home, within 60 s",
        steps=(
            do.put("RTL_RETURN_ALT", 15.0),
            do.takeoff(5.0),
            do.goto((30.0, 20.0, 8.0)),
            do.select(Mode.RETURN),
            do.until(see.above(14.5), within=15.0),
            do.until(see.DISARMED, within=60.0),
            do.check(see.every(see.over(0.0, 0.0, 0.1), see.height(0.0, 0.2))),
        ),
    ),
    Scenario(
        name="no-landing-is-detected-in-an-updraft",
        peer="AP AirModeLanding: not detected within 2 s",
        holds="not detected in a 3 m/s updraft; then lands",
        steps=(
            do.land(wait=False),
            do.hold(see.every(see.ARMED, see.mode(Mode.LAND)), for_=4.0),
            do.until(see.DISARMED, within=20.0),
            do.check(see.height(0.0, 0.1)),
        ),
        setting={"airborne": 5.0, "wind": str(UPDRAFT)},
    ),
    Scenario(
        name="takeoff-needs-arming",
        peer="ours",
        holds="selecting the mode on the ground keeps the rotors stopped",
        steps=(
            do.select(Mode.TAKEOFF),
            do.hold(see.every(see.DISARMED, see.height(0.0, 0.01)), for_=2.0),
            do.arm(),
            do.until(see.ARMED, within=0.1),
        ),
    ),
)
