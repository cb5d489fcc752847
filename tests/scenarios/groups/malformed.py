"""Malformed input: what no sane ground station sends."""

from math import inf, nan
from random import Random
from typing import Any

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.sitl import mission_items as items
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario
from tools.fuzz.messages import Messages

PLACE = (0.0, 0.0, 5.0)
STAYS = do.hold(see.every(see.near(PLACE, 0.01), see.ARMED, see.mode(Mode.HOLD)), for_=1.0)
FRAME: int = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
WAYPOINT: int = mav.MAV_CMD_NAV_WAYPOINT
TOO_MANY = 65535
MAX_COMMANDS = {mav.MAV_CMD_NAV_TAKEOFF: 7, mav.MAV_CMD_DO_CHANGE_SPEED: 7, mav.MAV_CMD_DO_SET_HOME: 7}


def send_noise(sitl: Sitl) -> None:
    chance = Random(1)
    whole = Codec(255, 190).encode("PARAM_REQUEST_READ", 1, 1, b"TRACK", -1)
    for number in range(400):
        sitl.gcs.send_raw(chance.randbytes(chance.randrange(1, 300)))
        sitl.gcs.send_raw(whole[: number % len(whole)])
        sitl.gcs.send_raw(whole + chance.randbytes(7))
        if number % 4 == 0:
            sitl.step()


@do.word
def fire(sitl: Sitl, count: int) -> None:
    messages = Messages(Random(7), ("TRACK", "MPC_XY_CRUISE"), tuple(MAX_COMMANDS))
    for number in range(count):
        sent = messages.any()
        if sent.name != "SETUP_SIGNING":  # a valid one is the owner's wish: without its key nobody is answered
            sitl.gcs.send_raw(sent.frame)
        if number % 20 == 0:
            sitl.step()


def still_answers(sitl: Sitl) -> None:
    before = sitl.gcs.counts["HEARTBEAT"]
    sitl.run(2.1)
    assert sitl.gcs.counts["HEARTBEAT"] - before >= 2
    assert sitl.get_param("SYS_AUTOSTART") == 4001


@do.word
def parameter_refused(sitl: Sitl, name: str, value: float) -> None:
    before = sitl.get_param(name)
    with pytest.raises(RefusedError):
        sitl.set_param(name, value)
    assert sitl.get_param(name) == before


def many_items_refused(sitl: Sitl) -> None:
    sitl.gcs.forget()
    announce = lambda _: sitl.send("MISSION_COUNT", sitl.system, 1, TOO_MANY, 0)  # noqa: E731
    sitl.gcs.request(announce, lambda: sitl.heard("MISSION_ACK"), "MISSION_ACK")
    assert sitl.gcs.latest("MISSION_ACK").type == mav.MAV_MISSION_NO_SPACE


def on_wire(**changes: Any) -> MissionItem:
    usual = MissionItem(FRAME, WAYPOINT, 1, 0.0, 0.3, 0.0, nan, 473977420, 85455940, 5.0)
    return usual._replace(**changes)


SCENARIOS = (
    Scenario(
        name="noise",
        peer="ours: dropped",
        holds="1200 random datagrams: holds position, answers",
        steps=(send_noise, STAYS, still_answers),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="random-valid-frames",
        peer="ours: 10⁶ frames, no exception (`make fuzz`); one out-of-range value once ended ArduPilot's SITL",
        holds="2000 frames: answers",
        steps=(fire(2000), still_answers),
    ),
    Scenario(
        name="invalid-positions",
        peer="AP: ignored",
        holds="NaN, infinite, beyond the poles: refused; holds position",
        steps=(
            *(
                do.command(mav.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, nan, *place, result=mav.MAV_RESULT_DENIED)
                for place in ((inf, 8.5, 500.0), (91.0, 8.5, 500.0), (47.4, 181.0, 500.0), (47.4, 8.5, inf))
            ),
            STAYS,
        ),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="invalid-parameters",
        peer="PX4: refused",
        holds="NaN, infinite, out of range, unknown: refused; the value stays",
        steps=(
            parameter_refused("MPC_XY_CRUISE", nan),
            parameter_refused("MPC_XY_CRUISE", inf),
            parameter_refused("MPC_XY_CRUISE", 1e6),
            parameter_refused("VEH_MASS", -1.0),
            parameter_refused("TRACK", 99),
        ),
    ),
    Scenario(
        name="invalid-missions",
        peer="PX4: INVALID_PARAMn",
        holds="each item refused; the mission stays empty",
        steps=(
            *(
                do.refused(do.upload(on_wire(**wrong)), "mission")
                for wrong in (
                    {"x": 2_000_000_000},
                    {"z": nan},
                    {"z": inf},
                    {"p1": -inf},
                    {"frame": 99},
                    {"command": 65535},
                )
            ),
            many_items_refused,
            do.check(see.DISARMED),
        ),
    ),
    Scenario(
        name="invalid-fences",
        peer="AP: refused",
        holds="two corners, negative and infinite radius: refused; arming succeeds, without a fence",
        steps=(
            do.refused(do.upload_fence(items.polygon([(0.0, 0.0), (1.0, 0.0)])), "fence"),
            do.refused(do.upload_fence(items.circle(-1.0)), "fence"),
            do.refused(do.upload_fence(items.circle(inf)), "fence"),
            do.arm(),
            do.check(see.ARMED),
        ),
    ),
    Scenario(
        name="extreme-setpoints",
        peer="AP SetpointBadVel",
        holds="10¹² m and 10⁹ m/s: speed within its limit, height kept",
        steps=(
            lambda sitl: sitl.run(0.2, lambda: sitl.setpoint(position=PLACE)),
            lambda sitl: sitl.select(Mode.OFFBOARD),
            lambda sitl: sitl.run(1.0, lambda: sitl.setpoint(position=(1e12, 0.0, 5.0))),
            lambda sitl: sitl.run(1.0, lambda: sitl.setpoint(velocity=(1e9, 0.0, 0.0))),
            do.measured("the speed", lambda columns: float(abs(columns["vx"]).max()), 12.5),
            do.check(see.height(5.0, 0.3)),
        ),
        setting={"airborne": 5.0},
    ),
)
