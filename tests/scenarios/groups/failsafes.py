"""Failsafes: links, battery, fence and deadlines that fail, and what the vehicle does then."""

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario

PLACE = (0.0, 0.0, 5.0)
IN_THE_AIR = {"airborne": 5.0}


@do.word
def charge_is(sitl: Sitl, state: int) -> None:
    sitl.run(1.1)
    assert sitl.gcs.latest("BATTERY_STATUS").charge_state == state


SCENARIOS = (
    Scenario(
        name="ground-station-lost",
        peer="AP: after doubling the timeout, stays in the mode at 1.5 times the old one, then RTL, then “Cleared”",
        holds="the same; return at the timeout, ± 0.2 s",
        steps=(
            *(
                do.put("NAV_DLL_ACT", 2),
                do.put("COM_DL_LOSS_T", 5),
                do.put("COM_DL_LOSS_T", 10),
                do.put("RTL_RETURN_ALT", 6.0),
            ),
            do.silence(),
            do.hold(see.mode(Mode.HOLD), for_=8.5),
            do.until(see.mode(Mode.RETURN), within=1.7),
            do.check(see.says("Failsafe activated: ground station lost, return")),
            do.silence(still=False),
            do.until(see.says("Failsafe cleared: ground station lost"), within=3.0),
            do.until(see.DISARMED, within=30.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="sticks-lost-before-takeoff",
        peer="AP: disarmed within 1 s",
        holds="disarmed within 0.7 s",
        steps=(
            do.by_hand(do.then(do.run(0.3), do.select(Mode.POSITION), do.arm()), thrust=0.0),
            do.until(see.DISARMED, within=0.7),
        ),
    ),
    Scenario(
        name="sticks-lost-in-flight",
        peer="AP: a failsafe within COM_RC_LOSS_T",
        holds="hold within 0.6 s, stays within 1 m",
        steps=(
            do.by_hand(do.then(do.run(0.3), do.select(Mode.POSITION), do.run(1.0))),
            do.until(see.mode(Mode.HOLD), within=0.62),
            do.moves_less(1.0, 3.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="battery-low-then-critical",
        peer="AP: low, RTL; critical, LAND; charge_state matches",
        holds="the same",
        steps=(
            *(do.put("COM_LOW_BAT_ACT", 1), do.put("BAT_LOW_THR", 0.3), do.put("BAT_CRIT_THR", 0.2)),
            do.inject("system_battery", "wrong", 0, 0.28),
            do.until(see.mode(Mode.RETURN), within=3.0),
            charge_is(mav.MAV_BATTERY_CHARGE_STATE_LOW),
            do.inject("system_battery", "wrong", 0, 0.15),
            do.until(see.mode(Mode.LAND), within=3.0),
            charge_is(mav.MAV_BATTERY_CHARGE_STATE_CRITICAL),
            do.until(see.DISARMED, within=30.0),
        ),
        setting={"airborne": 15.0, "start": {"x": 20.0}},
    ),
    Scenario(
        name="a-critical-landing-goes-on",
        peer="AP: not overridden by a later failsafe",
        holds="lands, although a ground station loss (return) follows",
        steps=(
            *(
                do.put("COM_LOW_BAT_ACT", 1),
                do.put("BAT_CRIT_THR", 0.2),
                do.put("NAV_DLL_ACT", 2),
                do.put("COM_DL_LOSS_T", 5),
            ),
            do.inject("system_battery", "wrong", 0, 0.15),
            do.until(see.mode(Mode.LAND), within=3.0),
            do.silence(),
            do.hold(see.mode(Mode.LAND), for_=7.0),
            do.until(see.DISARMED, within=30.0),
        ),
        setting={"airborne": 15.0, "start": {"x": 20.0}},
    ),
    Scenario(
        name="battery-too-empty-to-arm",
        peer="AP BatteryMissing: refused",
        holds="refused, with the charge in the reason",
        steps=(
            do.inject("system_battery", "wrong", 0, 0.02),
            do.run(2.0),
            do.refused(do.arm(), "battery"),
            do.check(see.DISARMED),
        ),
    ),
    Scenario(
        name="keeps-inside-the-fence",
        peer="AP: 12 ± 1 m for 70 s in a circle of 15 m",
        holds="at most 12.5 m, pushed outwards for 20 s",
        steps=(
            *(
                do.put("GF_ACTION", 2),
                do.put("GF_PREDICT", 1),
                do.put("GF_MARGIN", 3.0),
                do.put("GF_MAX_HOR_DIST", 15.0),
            ),
            do.by_hand(do.then(do.run(0.3), do.select(Mode.POSITION))),
            do.by_hand(do.run(20.0), pitch=1.0),
            do.measured("the distance from home", lambda columns: float(columns["y"].max()), 13.0),
            do.check(see.every(see.mode(Mode.HOLD), see.away(11.0))),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="fence-breached-returns",
        peer="AP: RTL within 30 s",
        holds="return within 0.5 s of the breach",
        steps=(
            *(do.put("GF_ACTION", 3), do.put("RTL_RETURN_ALT", 6.0)),
            do.upload_fence(items.polygon([(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)])),
            do.by_hand(do.then(do.run(0.3), do.select(Mode.POSITION))),
            do.by_hand(
                do.then(do.until(see.away(10.0), within=10.0), do.until(see.mode(Mode.RETURN), within=0.5)), pitch=1.0
            ),
            do.until(see.DISARMED, within=40.0),
            do.check(see.over(0.0, 0.0, 0.2)),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="height-fence",
        peer="AP: height fence",
        holds="20 m: return within 0.5 s",
        steps=(
            *(do.put("GF_ACTION", 3), do.put("GF_MAX_VER_DIST", 20.0)),
            do.by_hand(do.then(do.run(0.3), do.select(Mode.POSITION))),
            do.by_hand(do.until(see.mode(Mode.RETURN), within=10.0), thrust=1.0),
            do.check(see.height(20.2, 0.8)),
        ),
        setting={"airborne": 15.0},
    ),
    Scenario(
        name="a-target-outside-the-fence",
        peer="AP: FAILED",
        holds="refused; holds position",
        steps=(
            do.upload_fence(items.circle(10.0)),
            do.run(0.3),
            do.refused(do.goto((30.0, 0.0, 5.0), wait=False), "outside"),
            do.hold(see.every(see.near(PLACE, 0.02), see.mode(Mode.HOLD)), for_=1.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="deadline-missed",
        peer="ours",
        holds="solve time 12 ms, sample 8 ms: reported, hovers within 0.2 m",
        steps=(
            do.put("SIM_SOLVE_MS", 12.0),
            do.until(see.says("deadline missed"), within=2.0),
            do.hold(see.every(see.ARMED, see.near(PLACE, 0.2), see.tilted_less(5.0)), for_=5.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="tilted-too-far",
        peer="PX4: FD_FAIL_R, if CBRK_FLIGHTTERM permits",
        holds="0.3 s on its back: rotors stop, with the reason",
        steps=(do.until(see.DISARMED, within=0.5), do.run(0.2), do.check(see.says("tilted too far"))),
        calm="its reports end before a ground station connects over a rough link",
        setting={
            "airborne": 20.0,
            "start": {"phi": 180.0, "p": 0.0},
            "params": {"CBRK_FLIGHTTERM": 0, "FD_FAIL_R": 60.0, "FD_FAIL_R_TTRI": 0.1},
            "ready": False,
        },
    ),
)
