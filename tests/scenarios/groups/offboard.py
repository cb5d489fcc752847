"""Offboard: what a companion asks for, well and badly."""

from math import inf, nan

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.client.setpoints import attitude_target
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario

PLACE = (0.0, 0.0, 5.0)
THERE = (3.0, 2.0, 6.0)
CAMERA_TRIGGER: int = mav.MAV_CMD_DO_SET_CAM_TRIGG_DIST


def lost_at_its_time(sitl: Sitl) -> None:
    """Stop sending setpoints, and see when it notices: COM_OF_LOSS_T after the last, to a control sample."""
    timeout_s = float(sitl.get_param("COM_OF_LOSS_T"))
    do.setpoint(position=PLACE)(sitl)
    sitl.run(0.02, lambda: do.setpoint(position=PLACE)(sitl))
    began_s = sitl.time_s
    sitl.wait_until(lambda: sitl.mode is not Mode.OFFBOARD, within=timeout_s + 1.0, what="the loss to be noticed")
    assert abs(sitl.time_s - began_s - timeout_s) <= 0.02 + 0.008


def begin_offboard(sitl: Sitl) -> None:
    sitl.run(0.2, lambda: do.setpoint(position=PLACE)(sitl))
    sitl.select(Mode.OFFBOARD)


def silent_in_a_turn(sitl: Sitl) -> None:
    """Ask for a roll of 1.5 rad/s, and be silent: the vehicle may lean by what 0.3 s of it amount to."""

    def turn(rate_rad_s: float) -> None:
        name, fields = attitude_target((1, 1), rates=(rate_rad_s, 0.0, 0.0), thrust=0.5, time_us=sitl.time_us)
        sitl.gcs.send(name, *fields)

    sitl.run(0.3, lambda: turn(0.0))
    sitl.select(Mode.OFFBOARD)
    turn(1.5)
    do.hold(see.every(see.tilted_less(35.0), see.near(PLACE, 1.0)), for_=3.0)(sitl)


SCENARIOS = (
    Scenario(
        name="a-place",
        peer="PX4: 5 m to 0.3 m within 10 s",
        holds="to 0.02 m within 5 s",
        steps=(
            begin_offboard,
            do.until(
                see.every(see.near(THERE, 0.02), see.slower(0.1)), within=5.0, meanwhile=do.setpoint(position=THERE)
            ),
            do.hold(see.near(THERE, 0.02), for_=2.0, meanwhile=do.setpoint(position=THERE)),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="a-velocity",
        peer="ours",
        holds="3 m/s ± 0.02 m/s from 2 s on",
        steps=(
            begin_offboard,
            lambda sitl: sitl.run(2.0, lambda: do.setpoint(velocity=(3.0, 0.0, 0.0))(sitl)),
            do.hold(
                see.every(see.ground_speed(3.0, 0.02), see.climbs(0.0, 0.02)),
                for_=3.0,
                meanwhile=do.setpoint(velocity=(3.0, 0.0, 0.0)),
            ),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="offboard-without-setpoints",
        peer="PX4: refused",
        holds="refused, with advice",
        steps=(do.refused(do.select(Mode.OFFBOARD), "send them before the mode"), do.check(see.mode(Mode.HOLD))),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="bad-velocities-are-ignored",
        peer="AP SetpointBadVel: NaN, infinite: ignored",
        holds="stays within 0.05 m",
        steps=(
            begin_offboard,
            *(
                do.hold(see.near(PLACE, 0.05), for_=0.6, meanwhile=do.setpoint(velocity=bad))
                for bad in ((nan, 0.0, 0.0), (0.0, inf, 0.0), (0.0, 0.0, -inf), (nan, nan, nan))
            ),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="setpoints-lost",
        peer="ours: hold at the timeout, ± one step",
        holds="hold, ± a control sample and a setpoint interval, reported; within 0.1 m",
        steps=(
            begin_offboard,
            lost_at_its_time,
            do.hold(see.every(see.mode(Mode.HOLD), see.near(PLACE, 0.1), see.ARMED), for_=2.0),
            do.check(see.says("setpoints lost")),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="stale-body-rates",
        peer="PX4: followed until COM_OF_LOSS_T",
        holds="followed for 0.3 s: tilt below 35°, stays within 1 m",
        steps=(silent_in_a_turn,),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="a-place-on-sensors",
        peer="PX4: 5 m to 0.3 m within 10 s",
        holds="to 1 m of the truth within 8 s, in wind",
        steps=(
            do.takeoff(5.0),
            begin_offboard,
            do.until(
                see.every(see.near(THERE, 1.0), see.slower(0.5)), within=8.0, meanwhile=do.setpoint(position=THERE)
            ),
        ),
        setting={"feedback": "sensors", "wind": "4@90", "turbulence": "light", "seed": 2},
    ),
    Scenario(
        name="unsupported-command",
        peer="PX4: INVALID_PARAM or DENIED",
        holds="an unknown command is UNSUPPORTED at once, without effect",
        steps=(
            do.command(CAMERA_TRIGGER, 5.0, result=mav.MAV_RESULT_UNSUPPORTED),
            do.hold(see.near(PLACE, 0.02), for_=1.0),
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="mode-overrides-setpoints",
        peer="ours",
        holds="the selected mode wins over continuing setpoints",
        steps=(
            begin_offboard,
            do.select(Mode.HOLD),
            do.hold(
                see.every(see.mode(Mode.HOLD), see.near(PLACE, 0.05)), for_=2.0, meanwhile=do.setpoint(position=THERE)
            ),
        ),
        setting={"airborne": 5.0},
    ),
)
