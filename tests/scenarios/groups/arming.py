"""Arming: what may, what may not, and why."""

from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items
from tests.scenarios.words.conditions import ARMED, DISARMED, Condition, above, every, height, says
from tests.scenarios.words.scenario import Scenario
from tests.scenarios.words.steps import (
    arm,
    check,
    command,
    disarm,
    hold,
    land,
    refused,
    run,
    takeoff,
    until,
    upload_fence,
)

FAR_FENCE = mission_items.polygon([(100.0, 100.0), (110.0, 100.0), (110.0, 110.0), (100.0, 110.0)])
ARM_DISARM: int = mav.MAV_CMD_COMPONENT_ARM_DISARM
WRONG_MAGIC = 2989.0


SCENARIOS = (
    Scenario(
        name="armable-soon-after-the-start",
        peer="PX4: healthy within 30 s, armable within 45 s",
        holds="armed 0.1 s after the first heartbeat",
        steps=(arm(), until(ARMED, within=0.1)),
        calm="asks how soon",
    ),
    Scenario(
        name="armable-on-sensors-soon-after-the-start",
        peer="PX4: healthy within 30 s, armable within 45 s",
        holds="armed within 5 s, the estimator's alignment included",
        steps=(arm(), check(every(ARMED, Condition("within 5 s", lambda sitl: sitl.time_s <= 5.0)))),
        calm="asks how soon",
        setting={"feedback": "sensors"},
    ),
    Scenario(
        name="refused-outside-the-fence",
        peer="AP HorizontalFence: refused",
        holds="refused, and says so",
        steps=(upload_fence(FAR_FENCE), run(0.2), refused(arm(), "outside the geofence"), check(DISARMED)),
    ),
    Scenario(
        name="refused-with-a-bad-fence-radius",
        peer="AP: a bad fence radius is refused",
        holds="the fence itself is refused, and arming goes by the one before: none",
        steps=(refused(upload_fence(mission_items.circle(-3.0)), "fence"), arm(), check(ARMED)),
    ),
    Scenario(
        name="refused-when-tilted",
        peer="ours: refused beyond 45°",
        holds="refused on its back, and says by how much",
        steps=(run(1.0), refused(arm(), "tilted by 180 degrees"), check(DISARMED)),
        setting={"start": {"z": -0.05, "phi": 180.0}},
    ),
    Scenario(
        name="no-disarming-in-the-air",
        peer="ours: refused unless forced",
        holds="refused, and it flies on within 0.1 m",
        steps=(refused(disarm(), "flying"), hold(every(ARMED, height(5.0, 0.1)), for_=2.0)),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="disarmed-in-the-air-by-force",
        peer="ours: the magic number stops the rotors",
        holds="rotors stop at once, and it falls",
        steps=(
            disarm(force=True),
            check(DISARMED),
            run(0.8),
            check(every(DISARMED, says("rotors stopped in the air"))),
        ),
        setting={"airborne": 8.0},
    ),
    Scenario(
        name="force-needs-its-number",
        peer="ours: no other number forces",
        holds="refused in the air with another number; armed stays armed",
        steps=(
            command(ARM_DISARM, 0.0, WRONG_MAGIC, result=mav.MAV_RESULT_DENIED),
            hold(every(ARMED, above(4.5)), for_=1.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="disarms-by-itself-when-nothing-is-flown",
        peer="PX4: after COM_DISARM_PRFLT, 10 s",
        holds="armed for 9.9 s, disarmed within 10.2 s",
        steps=(arm(), hold(ARMED, for_=9.9), until(DISARMED, within=0.3)),
    ),
    Scenario(
        name="arms-again-after-a-landing",
        peer="ours",
        holds="two flights, one after the other",
        steps=(
            *(takeoff(2.0), land(), check(DISARMED)),
            *(takeoff(2.0), land(), check(DISARMED)),
        ),
    ),
)
