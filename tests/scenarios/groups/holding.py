"""Hold, wind and attitude."""

from math import radians

from colibri.autopilot.commander.rules.modes import Mode
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario

PLACE = (0.0, 0.0, 5.0)
KICKED = {"airborne": 5.0, "start": {"p": radians(400.0)}}


SCENARIOS = (
    Scenario(
        name="altitude-hold",
        peer="AP ModeAltHold: ± 1 m for 5 s",
        holds="± 0.05 m for 5 s",
        steps=(
            do.by_hand(
                do.then(
                    do.run(0.3),
                    do.select(Mode.ALTITUDE),
                    do.hold(see.every(see.mode(Mode.ALTITUDE), see.height(5.0, 0.05)), for_=5.0),
                )
            ),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="loiter",
        peer="AP ModeLoiter: within 5 m for 10 s",
        holds="within 0.01 m for 10 s",
        steps=(do.hold(see.near(PLACE, 0.01), for_=10.0),),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="steady-wind",
        peer="ours: 5 m/s, at most 0.5 m",
        holds="at most 0.3 m until estimated, then 0.01 m",
        steps=(do.hold(see.near(PLACE, 0.3), for_=10.0), do.hold(see.near(PLACE, 0.01), for_=5.0)),
        setting={"airborne": 5.0, "wind": "5@270"},
    ),
    Scenario(
        name="gusts-and-turbulence",
        peer="ours: Dryden, 20 seeds",
        holds="within 0.15 m for 10 s in 5 m/s and moderate turbulence",
        steps=(do.run(3.0), do.hold(see.near(PLACE, 0.15), for_=10.0)),
        setting={"airborne": 5.0, "wind": "5@270", "turbulence": "moderate"},
        seeds=tuple(range(1, 21)),
    ),
    Scenario(
        name="one-hard-gust",
        peer="ours: 1 - cosine, 10 m/s within 2 s",
        holds="at most 0.3 m, back within 0.02 m after 3 s",
        steps=(
            do.run(5.0),
            do.measured("the distance", do.max_distance_from(PLACE), 0.3),
            do.run(1.0),
            do.hold(see.near(PLACE, 0.02), for_=1.0),
        ),
        setting={"airborne": 5.0, "gusts": ("10@270:start=1,duration=2",)},
    ),
    Scenario(
        name="a-kick",
        peer="AP AirMode: roll 1° to 20°",
        holds="400°/s: roll between 1° and 20°, level within 1.5 s",
        steps=(
            do.run(1.5),
            do.measured("the tilt", do.max_tilt, 20.0, minimum=1.0),
            do.check(see.every(see.tilted_less(1.0), see.near(PLACE, 0.3))),
        ),
        setting=KICKED,
    ),
    Scenario(
        name="attitude-step",
        peer="PX4: -20° pitch, error below 5° after 3 s",
        holds="error below 0.5° after 1 s",
        steps=(
            do.put("MPC_MAN_TILT_MAX", 20.0),
            do.by_hand(do.then(do.run(0.3), do.select(Mode.STABILIZED))),
            do.by_hand(do.run(1.0), pitch=1.0, thrust=0.45),
            do.check(see.Condition("tilt 20 ± 0.5°", lambda sitl: abs(sitl.tilt_deg - 20.0) < 0.5)),
        ),
        setting={"airborne": 20.0},
    ),
    Scenario(
        name="a-payload",
        peer="ours: 15 % above the assumed mass",
        holds="within 0.5 m after 1 s, 0.02 m after 4 s",
        steps=(do.hold(see.near(PLACE, 0.5), for_=4.0), do.hold(see.near(PLACE, 0.02), for_=3.0)),
        setting={"airborne": 5.0, "params": {"VEH_MASS": 0.607}},
    ),
    Scenario(
        name="position-mode-brakes",
        peer="ours",
        holds="from 5 m/s by sticks: stops within 4 s, then stays within 0.05 m",
        steps=(
            do.by_hand(do.then(do.run(0.3), do.select(Mode.POSITION))),
            do.by_hand(do.run(4.0), pitch=1.0),
            do.by_hand(
                do.then(
                    do.until(see.slower(0.05), within=4.0),
                    do.hold(see.every(see.slower(0.1), see.height(5.0, 0.1)), for_=2.0),
                )
            ),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="goto",
        peer="PX4: 5 m to 0.3 m within 10 s",
        holds="5 m to 0.05 m within 8 s",
        steps=(
            do.goto((5.0, 0.0, 5.0), wait=False),
            do.until(see.every(see.near((5.0, 0.0, 5.0), 0.05), see.slower(0.2)), within=8.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="upside-down",
        peer="ours",
        holds="upright within 2 s, at most 4 m lost, back within 0.1 m after 6 s",
        steps=(
            do.until(see.tilted_less(10.0), within=2.0),
            do.hold(see.every(see.ARMED, see.above(16.0)), for_=4.0),
            do.run(2.0),
            do.check(see.every(see.height(20.0, 0.5), see.slower(0.5))),
        ),
        setting={"airborne": 20.0, "start": {"phi": 180.0}},
    ),
)
