"""Arming: what may, what may not, and why."""

from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario

FAR_FENCE = items.polygon([(100.0, 100.0), (110.0, 100.0), (110.0, 110.0), (100.0, 110.0)])
ARM_DISARM: int = mav.MAV_CMD_COMPONENT_ARM_DISARM
WRONG_MAGIC = 2989.0


SCENARIOS = (
    Scenario(
        name="armable-soon-after-the-start",
        peer="PX4: healthy within 30 s, armable within 45 s",
        holds="armed 0.1 s after the first heartbeat",
        steps=(do.arm(), do.until(see.ARMED, within=0.1)),
        calm="measures the start-up time",
    ),
    Scenario(
        name="armable-on-sensors-soon-after-the-start",
        peer="PX4: healthy within 30 s, armable within 45 s",
        holds="armed within 5 s, the estimator's alignment included",
        steps=(do.arm(), do.check(see.every(see.ARMED, see.Condition("within 5 s", lambda sitl: sitl.time_s <= 5.0)))),
        calm="measures the start-up time",
        setting={"feedback": "sensors"},
    ),
    Scenario(
        name="refused-outside-the-fence",
        peer="AP HorizontalFence: refused",
        holds="refused with the reason",
        steps=(
            do.upload_fence(FAR_FENCE),
            do.run(0.2),
            do.refused(do.arm(), "outside the geofence"),
            do.check(see.DISARMED),
        ),
    ),
    Scenario(
        name="refused-with-a-bad-fence-radius",
        peer="AP: refused",
        holds="the upload is refused; arming succeeds, without a fence",
        steps=(do.refused(do.upload_fence(items.circle(-3.0)), "fence"), do.arm(), do.check(see.ARMED)),
    ),
    Scenario(
        name="refused-when-tilted",
        peer="ours: refused beyond 45°",
        holds="refused on its back, with the tilt in the reason",
        steps=(do.run(1.0), do.refused(do.arm(), "tilted by 180 degrees"), do.check(see.DISARMED)),
        setting={"start": {"z": -0.05, "phi": 180.0}},
    ),
    Scenario(
        name="no-disarming-in-the-air",
        peer="ours: refused unless forced",
        holds="refused; hovers within 0.1 m",
        steps=(do.refused(do.disarm(), "not landed"), do.hold(see.every(see.ARMED, see.height(5.0, 0.1)), for_=2.0)),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="disarmed-in-the-air-by-force",
        peer="ours: the magic number stops the rotors",
        holds="rotors stop at once",
        steps=(
            do.disarm(force=True),
            do.check(see.DISARMED),
            do.run(0.8),
            do.check(see.every(see.DISARMED, see.says("Disarmed in flight"))),
        ),
        setting={"airborne": 8.0},
    ),
    Scenario(
        name="force-needs-magic-number",
        peer="ours: any other number is refused",
        holds="refused in the air; stays armed",
        steps=(
            do.command(ARM_DISARM, 0.0, WRONG_MAGIC, result=mav.MAV_RESULT_DENIED),
            do.hold(see.every(see.ARMED, see.above(4.5)), for_=1.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="disarms-without-takeoff",
        peer="PX4: after COM_DISARM_PRFLT, 10 s",
        holds="armed for 9.9 s, disarmed within 10.2 s",
        steps=(do.arm(), do.hold(see.ARMED, for_=9.9), do.until(see.DISARMED, within=0.3)),
    ),
    Scenario(
        name="arms-again-after-a-landing",
        peer="ours",
        holds="a second flight after the first",
        steps=(
            *(do.takeoff(2.0), do.land(), do.check(see.DISARMED)),
            *(do.takeoff(2.0), do.land(), do.check(see.DISARMED)),
        ),
    ),
)
