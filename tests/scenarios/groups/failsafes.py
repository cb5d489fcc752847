"""Failsafes and faults: what is lost, and what the vehicle does then."""

from math import dist, hypot, sqrt

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items
from colibri.sitl.flight_record import Columns, tilt_deg
from colibri.sitl.vehicle import Sitl
from tests.scenarios.groups import missions
from tests.scenarios.words.conditions import (
    ARMED,
    DISARMED,
    away,
    every,
    height,
    mode,
    near,
    over,
    quiet_about,
    says,
    tilted_less,
)
from tests.scenarios.words.scenario import Scenario, Step
from tests.scenarios.words.steps import (
    arm,
    by_hand,
    check,
    command,
    goto,
    hold,
    inject,
    land,
    measured,
    put,
    refused,
    run,
    select,
    silence,
    start_mission,
    takeoff,
    then,
    until,
    upload,
    upload_fence,
)

PLACE = (0.0, 0.0, 5.0)
INJECT: int = mav.MAV_CMD_INJECT_FAILURE
GPS_OFF = (float(mav.FAILURE_UNIT_SENSOR_GPS), float(mav.FAILURE_TYPE_OFF))
MOTOR_OFF = (float(mav.FAILURE_UNIT_SYSTEM_MOTOR), float(mav.FAILURE_TYPE_OFF), 1.0)
IN_THE_AIR = {"airborne": 5.0}
ON_SENSORS = {"feedback": "sensors"}


def charge_is(state: int) -> Step:
    """See what BATTERY_STATUS calls the charge."""

    def step(sitl: Sitl) -> None:
        sitl.run(1.1)
        assert sitl.gcs.latest("BATTERY_STATUS").charge_state == state

    return step


def touches_down_slower(m_s: float) -> Step:
    """See how fast it came to the ground."""

    def fastest(columns: Columns) -> float:
        low = (columns["z"] < 0.5) & (columns["z"] > 0.02)
        return float(-columns["vz"][low].min())

    return measured("the speed at the ground", fastest, m_s)


def lands_on_three(number: int, *, tilt: float, within_s: float) -> Step:
    """Lose a rotor, and see it say so, land, and point its thrust straight up from so long after the loss on."""

    def step(sitl: Sitl) -> None:
        sitl.inject("system_motor", "off", number)
        upright_s = sitl.time_s + within_s
        until(says(f"rotor {number} failed"), within=0.5)(sitl)
        until(DISARMED, within=40.0)(sitl)
        measured("the tilt", max_tilt_in_the_air, tilt, last_s=sitl.time_s - upright_s)(sitl)

    return step


def max_tilt_in_the_air(columns: Columns) -> float:
    """Return the figure: the largest tilt off the ground, degrees."""
    return float(tilt_deg(columns)[columns["z"] > 0.1].max())


def falls_like_a_stone(sitl: Sitl) -> None:
    """See that the rotors stop within 2 s and the time that a fall takes."""
    max_s = 2.0 + sqrt(2.0 * sitl.position[2] / 10.0)
    sitl.wait_until(lambda: not sitl.armed, within=max_s, what="the end of the flight")


def stays_away(sitl: Sitl) -> None:
    """See that it does not fly to the origin of all coordinates."""
    sitl.hold(lambda: hypot(*sitl.position[:2]) >= 5.0, for_=15.0, what="at least 5 m from the origin")


def descends_less(max_m: float, seconds: float) -> Step:
    """See that it does not lose more than that."""

    def step(sitl: Sitl) -> None:
        began_m = sitl.position[2]
        sitl.hold(lambda: sitl.position[2] > began_m - max_m, for_=seconds, what=f"at most {max_m:g} m lost")

    return step


def moves_less(max_m: float, seconds: float, tilt: float = 90.0) -> Step:
    """See that it stays about where it is."""

    def step(sitl: Sitl) -> None:
        began = sitl.position
        near_and_level = lambda: dist(sitl.position, began) <= max_m and sitl.tilt_deg <= tilt  # noqa: E731
        sitl.hold(near_and_level, for_=seconds, what=f"at most {max_m:g} m away")

    return step


SCENARIOS = (
    Scenario(
        name="ground-station-lost",
        peer="AP: nothing at 1.5 times the old timeout after doubling it, then RTL, then “Cleared”",
        holds="the same; return at the timeout, ± 0.2 s",
        steps=(
            *(put("NAV_DLL_ACT", 2), put("COM_DL_LOSS_T", 5), put("COM_DL_LOSS_T", 10), put("RTL_RETURN_ALT", 6.0)),
            silence(),
            hold(mode(Mode.HOLD), for_=8.5),
            until(mode(Mode.RETURN), within=1.7),
            check(says("ground station lost: return")),
            silence(still=False),
            until(says("ground station lost: cleared"), within=3.0),
            until(DISARMED, within=30.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="sticks-lost-before-takeoff",
        peer="AP: disarmed within 1 s",
        holds="disarmed within 0.7 s",
        steps=(
            by_hand(then(run(0.3), select(Mode.POSITION), arm()), thrust=0.0),
            until(DISARMED, within=0.7),
        ),
    ),
    Scenario(
        name="sticks-lost-in-flight",
        peer="AP: a failsafe within COM_RC_LOSS_T",
        holds="hold within 0.6 s, stays within 1 m",
        steps=(
            by_hand(then(run(0.3), select(Mode.POSITION), run(1.0))),
            until(mode(Mode.HOLD), within=0.62),
            moves_less(1.0, 3.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="position-lost-lands",
        peer="PX4: lands, disarmed within 30 s",
        holds="descends at once, disarmed within 30 s, at most 5 m away",
        steps=(
            put("COM_GNSSLOSS_ACT", 4),
            takeoff(5.0),
            inject("sensor_gps", "off"),
            until(mode(Mode.LAND), within=3.0),
            until(DISARMED, within=27.0),
            check(over(0.0, 0.0, 5.0)),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gps-lost-in-hover",
        peer="ours: 20 s without, at most 20 m",
        holds="at most 3 m, says so, and is back within 1 m 10 s after GPS is",
        steps=(
            takeoff(5.0),
            inject("sensor_gps", "off"),
            moves_less(3.0, 20.0),
            check(says("GPS lost")),
            inject("sensor_gps", "ok"),
            run(10.0),
            check(every(over(0.0, 0.0, 1.5), says("GPS lost: cleared"))),
        ),
        setting=ON_SENSORS,
        seeds=(1, 2),
    ),
    Scenario(
        name="no-jump-to-the-origin",
        peer="AP PositionWhenGPSIsZero: stays 5 m away",
        holds="stays 5 m away for 15 s",
        steps=(takeoff(5.0), goto((8.0, 0.0, 5.0)), inject("sensor_gps", "off"), stays_away),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gps-glitch",
        peer="AP: at most 20 m in 30 s, tilt at most 2° for 20 s",
        holds="a jump of 40 m for 5 s: at most 2 m, tilt at most 2°",
        steps=(
            takeoff(5.0),
            run(2.0),
            inject("sensor_gps", "wrong", 0, 40.0, 0.0, 0.0),
            moves_less(2.0, 5.0, tilt=2.0),
            inject("sensor_gps", "ok"),
            moves_less(2.0, 15.0, tilt=2.0),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="accelerometer-bias",
        peer="AP: 2 m/s², descends at most 2 m in 50 s",
        holds="at most 1.5 m in 50 s",
        steps=(takeoff(10.0), inject("sensor_accel", "wrong", 0, 0.0, 0.0, 2.0), descends_less(1.5, 50.0)),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gyroscope-bias",
        peer="ours: a bias is learned in flight",
        holds="0.1 rad/s: at most 1 m in 30 s, and says so",
        steps=(
            takeoff(10.0),
            inject("sensor_gyro", "wrong", 0, 0.1, 0.0, 0.0),
            moves_less(1.0, 30.0),
            check(says("gyroscope off: bias learned anew")),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="stuck-barometer-on-a-mission",
        peer="PX4: a stuck sensor, the mission ends within 90 s",
        holds="ends, and lands within 3 m",
        steps=(
            upload([mission_items.takeoff(10.0), *missions.CORRIDOR, mission_items.land(0.0, 0.0)]),
            start_mission,
            run(10.0),
            inject("sensor_baro", "stuck"),
            until(DISARMED, within=80.0),
            check(over(0.0, 0.0, 3.0)),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="magnetometer-off-in-flight",
        peer="PX4: a sensor off, the mission ends",
        holds="goes 10 m and back, lands within 2 m",
        steps=(
            takeoff(5.0),
            inject("sensor_mag", "off"),
            goto((10.0, 0.0, 5.0)),
            goto(PLACE),
            land(),
            check(over(0.0, 0.0, 2.0)),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gyroscope-off",
        peer="ours: attitude lost, the rotors stop",
        holds="within 2 s and the time of a fall, and says why",
        steps=(takeoff(5.0), inject("sensor_gyro", "off"), falls_like_a_stone, check(says("attitude lost"))),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="battery-low-then-critical",
        peer="AP: low, RTL; critical, LAND; charge_state matches",
        holds="the same",
        steps=(
            *(put("COM_LOW_BAT_ACT", 1), put("BAT_LOW_THR", 0.3), put("BAT_CRIT_THR", 0.2)),
            inject("system_battery", "wrong", 0, 0.28),
            until(mode(Mode.RETURN), within=3.0),
            charge_is(mav.MAV_BATTERY_CHARGE_STATE_LOW),
            inject("system_battery", "wrong", 0, 0.15),
            until(mode(Mode.LAND), within=3.0),
            charge_is(mav.MAV_BATTERY_CHARGE_STATE_CRITICAL),
            until(DISARMED, within=30.0),
        ),
        setting={"airborne": 15.0, "start": {"x": 20.0}},
    ),
    Scenario(
        name="a-critical-landing-goes-on",
        peer="AP: not overridden by a later failsafe",
        holds="lands, though the ground station is lost meanwhile and would have it return",
        steps=(
            *(put("COM_LOW_BAT_ACT", 1), put("BAT_CRIT_THR", 0.2), put("NAV_DLL_ACT", 2), put("COM_DL_LOSS_T", 5)),
            inject("system_battery", "wrong", 0, 0.15),
            until(mode(Mode.LAND), within=3.0),
            silence(),
            hold(mode(Mode.LAND), for_=7.0),
            until(DISARMED, within=30.0),
        ),
        setting={"airborne": 15.0, "start": {"x": 20.0}},
    ),
    Scenario(
        name="battery-too-empty-to-arm",
        peer="AP BatteryMissing: refused",
        holds="refused, and says how full it is",
        steps=(
            inject("system_battery", "wrong", 0, 0.02),
            run(2.0),
            refused(arm(), "battery"),
            check(DISARMED),
        ),
    ),
    Scenario(
        name="a-weak-rotor",
        peer="AP StabilityPatch: 65 %, within 10 m and 5 m of height for 30 s",
        holds="within 0.3 m for 30 s",
        steps=(inject("system_motor", "wrong", 1, 0.65), moves_less(0.3, 30.0), check(quiet_about("failed"))),
        setting={"airborne": 10.0},
    ),
    *(
        Scenario(
            name=f"rotor-{number}-lost",
            peer="PX4: terminated within 2 + √(2h/10) s; ours: upright to within 20°, lands within 5 m at 2 m/s",
            holds="lands on three, says so; at most 2 m/s at the ground, 5 m away, 20° from 2 s on",
            steps=(
                run(1.0),
                lands_on_three(number, tilt=20.0, within_s=2.0),
                touches_down_slower(2.0),
                check(over(0.0, 0.0, 5.0)),
            ),
            setting={"airborne": 10.0},
        )
        for number in (1, 2, 3, 4)
    ),
    Scenario(
        name="rotor-lost-on-sensors",
        peer="ours: upright to within 20°, lands within 5 m at 2 m/s",
        holds="the same",
        steps=(
            takeoff(10.0),
            run(1.0),
            inject("system_motor", "off", 2),
            until(DISARMED, within=40.0),
            touches_down_slower(2.0),
            check(over(0.0, 0.0, 5.0)),
        ),
        setting=ON_SENSORS,
        seeds=(1, 2),
    ),
    Scenario(
        name="keeps-inside-the-fence",
        peer="AP: 12 ± 1 m for 70 s in a circle of 15 m",
        holds="at most 12.5 m, pushed outwards for 20 s",
        steps=(
            *(put("GF_ACTION", 2), put("GF_PREDICT", 1), put("GF_MARGIN", 3.0), put("GF_MAX_HOR_DIST", 15.0)),
            by_hand(then(run(0.3), select(Mode.POSITION))),
            by_hand(run(20.0), pitch=1.0),
            measured("the distance from home", lambda columns: float(columns["y"].max()), 13.0),
            check(every(mode(Mode.HOLD), away(11.0))),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="fence-breached-returns",
        peer="AP: RTL within 30 s",
        holds="return within 0.5 s of the breach",
        steps=(
            *(put("GF_ACTION", 3), put("RTL_RETURN_ALT", 6.0)),
            upload_fence(mission_items.polygon([(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)])),
            by_hand(then(run(0.3), select(Mode.POSITION))),
            by_hand(then(until(away(10.0), within=10.0), until(mode(Mode.RETURN), within=0.5)), pitch=1.0),
            until(DISARMED, within=40.0),
            check(over(0.0, 0.0, 0.2)),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="too-high-is-a-breach",
        peer="AP: a fence of height",
        holds="20 m: return within 0.5 s",
        steps=(
            *(put("GF_ACTION", 3), put("GF_MAX_VER_DIST", 20.0)),
            by_hand(then(run(0.3), select(Mode.POSITION))),
            by_hand(until(mode(Mode.RETURN), within=10.0), thrust=1.0),
            check(height(20.2, 0.8)),
        ),
        setting={"airborne": 15.0},
    ),
    Scenario(
        name="a-target-outside-the-fence",
        peer="AP: FAILED",
        holds="refused, and it stays",
        steps=(
            upload_fence(mission_items.circle(10.0)),
            run(0.3),
            refused(goto((30.0, 0.0, 5.0), wait=False), "outside"),
            hold(every(near(PLACE, 0.02), mode(Mode.HOLD)), for_=1.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="injection-needs-leave",
        peer="PX4: refused where it is disabled",
        holds="DENIED while SYS_FAILURE_EN is 0, done when it is 1, UNSUPPORTED where nothing would fail",
        steps=(
            command(INJECT, *MOTOR_OFF, result=mav.MAV_RESULT_DENIED),
            hold(near(PLACE, 0.01), for_=1.0),
            put("SYS_FAILURE_EN", 1),
            command(INJECT, *GPS_OFF, result=mav.MAV_RESULT_UNSUPPORTED),
            command(INJECT, *MOTOR_OFF, result=mav.MAV_RESULT_ACCEPTED),
            until(says("rotor 1 failed"), within=0.5),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="deadline-missed-is-said",
        peer="ours",
        holds="12 ms of 8: says so, and still hovers within 0.2 m",
        steps=(
            put("SIM_SOLVE_MS", 12.0),
            until(says("control deadline missed"), within=2.0),
            hold(every(ARMED, near(PLACE, 0.2), tilted_less(5.0)), for_=5.0),
        ),
        setting=IN_THE_AIR,
    ),
    Scenario(
        name="tilted-too-far-is-the-end",
        peer="PX4: FD_FAIL_R, where CBRK_FLIGHTTERM lets it",
        holds="on its back for 0.3 s: the rotors stop, and it says why",
        steps=(until(DISARMED, within=0.5), run(0.2), check(says("tilted too far"))),
        calm="what it says is over before a ground station on a rough link is known to it",
        setting={
            "airborne": 20.0,
            "start": {"phi": 180.0, "p": 0.0},
            "params": {"CBRK_FLIGHTTERM": 0, "FD_FAIL_R": 60.0, "FD_FAIL_R_TTRI": 0.1},
            "ready": False,
        },
    ),
)
