"""Faults of the plant, in sensors and rotors, and what the vehicle does then."""

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.flight_record import Columns, tilt_deg
from colibri.sitl.vehicle import Sitl
from tests.scenarios.groups import missions
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario, Step

PLACE = (0.0, 0.0, 5.0)
INJECT: int = mav.MAV_CMD_INJECT_FAILURE
GPS_OFF = (float(mav.FAILURE_UNIT_SENSOR_GPS), float(mav.FAILURE_TYPE_OFF))
MOTOR_OFF = (float(mav.FAILURE_UNIT_SYSTEM_MOTOR), float(mav.FAILURE_TYPE_OFF), 1.0)
IN_THE_AIR = {"airborne": 5.0}
ON_SENSORS = {"feedback": "sensors"}


def touches_down_slower(m_s: float) -> Step:
    def fastest(columns: Columns) -> float:
        low = (columns["z"] < 0.5) & (columns["z"] > 0.02)
        return float(-columns["vz"][low].min())

    return do.measured("the speed at the ground", fastest, m_s)


@do.word
def lands_on_three(sitl: Sitl, number: int, *, tilt: float, within_s: float) -> None:
    """Lose a rotor, and see it say so, land, and point its thrust straight up from so long after the loss on."""
    sitl.inject("system_motor", "off", number)
    upright_s = sitl.time_s + within_s
    do.until(see.says(f"rotor {number} failed"), within=0.5)(sitl)
    do.until(see.DISARMED, within=40.0)(sitl)
    do.measured("the tilt", max_tilt_in_the_air, tilt, last_s=sitl.time_s - upright_s)(sitl)


def max_tilt_in_the_air(columns: Columns) -> float:
    return float(tilt_deg(columns)[columns["z"] > 0.1].max())


@do.word
def descends_less(sitl: Sitl, max_m: float, seconds: float) -> None:
    began_m = sitl.position[2]
    sitl.hold(lambda: sitl.position[2] > began_m - max_m, for_=seconds, what=f"at most {max_m:g} m lost")


SCENARIOS = (
    Scenario(
        name="position-lost-lands",
        peer="PX4: lands, disarmed within 30 s",
        holds="descends at once, disarmed within 30 s, at most 5 m away",
        steps=(
            do.put("COM_GNSSLOSS_ACT", 4),
            do.takeoff(5.0),
            do.inject("sensor_gps", "off"),
            do.until(see.mode(Mode.LAND), within=3.0),
            do.until(see.DISARMED, within=27.0),
            do.check(see.over(0.0, 0.0, 5.0)),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gps-lost-in-hover",
        peer="ours: 20 s without, at most 20 m",
        holds="at most 3 m, reported; within 1 m 10 s after GPS returns",
        steps=(
            do.takeoff(5.0),
            do.inject("sensor_gps", "off"),
            do.moves_less(3.0, 20.0),
            do.check(see.says("GPS lost")),
            do.inject("sensor_gps", "ok"),
            do.run(10.0),
            do.check(see.every(see.over(0.0, 0.0, 1.5), see.says("Failsafe cleared: GPS lost"))),
        ),
        setting=ON_SENSORS,
        seeds=(1, 2),
    ),
    Scenario(
        name="no-jump-to-the-origin",
        peer="AP PositionWhenGPSIsZero: stays 5 m away",
        holds="stays 5 m away for 15 s",
        steps=(
            do.takeoff(5.0),
            do.goto((8.0, 0.0, 5.0)),
            do.inject("sensor_gps", "off"),
            do.hold(see.away(5.0), for_=15.0),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gps-glitch",
        peer="AP: at most 20 m in 30 s, tilt at most 2° for 20 s",
        holds="a jump of 40 m for 5 s: at most 2 m, tilt at most 2°",
        steps=(
            do.takeoff(5.0),
            do.run(2.0),
            do.inject("sensor_gps", "wrong", 0, 40.0, 0.0, 0.0),
            do.moves_less(2.0, 5.0, tilt=2.0),
            do.inject("sensor_gps", "ok"),
            do.moves_less(2.0, 15.0, tilt=2.0),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="accelerometer-bias",
        peer="AP: 2 m/s², descends at most 2 m in 50 s",
        holds="at most 1.5 m in 50 s",
        steps=(do.takeoff(10.0), do.inject("sensor_accel", "wrong", 0, 0.0, 0.0, 2.0), descends_less(1.5, 50.0)),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gyroscope-bias",
        peer="ours: bias estimated in flight",
        holds="0.1 rad/s: at most 1 m in 30 s, reported",
        steps=(
            do.takeoff(10.0),
            do.inject("sensor_gyro", "wrong", 0, 0.1, 0.0, 0.0),
            do.moves_less(1.0, 30.0),
            do.check(see.says("gyroscope off: bias reset")),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="stuck-barometer-on-a-mission",
        peer="PX4: a stuck sensor, the mission ends within 90 s",
        holds="ends; lands within 3 m",
        steps=(
            *missions.ALONG_THE_CORRIDOR,
            do.run(10.0),
            do.inject("sensor_baro", "stuck"),
            do.until(see.DISARMED, within=80.0),
            do.check(see.over(0.0, 0.0, 3.0)),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="magnetometer-off-in-flight",
        peer="PX4: a sensor off, the mission ends",
        holds="goes 10 m and back, lands within 2 m",
        steps=(
            do.takeoff(5.0),
            do.inject("sensor_mag", "off"),
            do.goto((10.0, 0.0, 5.0)),
            do.goto(PLACE),
            do.land(),
            do.check(see.over(0.0, 0.0, 2.0)),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="gyroscope-off",
        peer="ours: the rotor model replaces it",
        holds="lands at most 2 m/s fast, tilt at most 30°, reported",
        steps=(
            do.takeoff(5.0),
            do.inject("sensor_gyro", "off"),
            do.until(see.DISARMED, within=40.0),
            touches_down_slower(2.0),
            do.measured("the tilt", max_tilt_in_the_air, 30.0),
            do.check(see.says("gyroscope lost")),
        ),
        setting=ON_SENSORS,
    ),
    Scenario(
        name="a-weak-rotor",
        peer="AP StabilityPatch: 65 %, within 10 m and 5 m of height for 30 s",
        holds="within 0.3 m for 30 s",
        steps=(
            do.inject("system_motor", "wrong", 1, 0.65),
            do.moves_less(0.3, 30.0),
            do.check(see.quiet_about("failed")),
        ),
        setting={"airborne": 10.0},
    ),
    *(
        Scenario(
            name=f"rotor-{number}-lost",
            peer="PX4: terminated within 2 + √(2h/10) s; ours: tilt at most 20°, lands within 5 m at 2 m/s",
            holds="lands on three rotors, reported; touchdown at most 2 m/s, 5 m away; tilt at most 20° after 2 s",
            steps=(
                do.run(1.0),
                lands_on_three(number, tilt=20.0, within_s=2.0),
                touches_down_slower(2.0),
                do.check(see.over(0.0, 0.0, 5.0)),
            ),
            setting={"airborne": 10.0},
        )
        for number in (1, 2, 3, 4)
    ),
    Scenario(
        name="rotor-lost-on-sensors",
        peer="ours: tilt at most 20°, lands within 5 m at 2 m/s",
        holds="the same",
        steps=(
            do.takeoff(10.0),
            do.run(1.0),
            do.inject("system_motor", "off", 2),
            do.until(see.DISARMED, within=40.0),
            touches_down_slower(2.0),
            do.check(see.over(0.0, 0.0, 5.0)),
        ),
        setting=ON_SENSORS,
        seeds=(1, 2),
    ),
    Scenario(
        name="injection-needs-permission",
        peer="PX4: refused while disabled",
        holds="DENIED while SYS_FAILURE_EN is 0, injected at 1, UNSUPPORTED without effect",
        steps=(
            do.command(INJECT, *MOTOR_OFF, result=mav.MAV_RESULT_DENIED),
            do.hold(see.near(PLACE, 0.01), for_=1.0),
            do.put("SYS_FAILURE_EN", 1),
            do.command(INJECT, *GPS_OFF, result=mav.MAV_RESULT_UNSUPPORTED),
            do.command(INJECT, *MOTOR_OFF, result=mav.MAV_RESULT_ACCEPTED),
            do.until(see.says("rotor 1 failed"), within=0.5),
        ),
        setting=IN_THE_AIR,
    ),
)
