"""Tracks: how closely they are flown, how fast, and what happens where they cannot be."""

from collections.abc import Callable
from math import degrees

import numpy as np

from colibri.autopilot.guidance.trajectories.planner import start_yaw
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.flight_record import Columns
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario, Step


def off_track(name: str, since_s: float) -> Callable[[Columns], float]:
    """Return the figure: RMS of the distance to a track that is flown from time 0 on."""

    def figure(columns: Columns) -> float:
        late = columns["t"] >= since_s
        error = do.places(columns)[late] - position(track(name), columns["t"][late])
        return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))

    return figure


def on_track(name: str, *, rms_m: float, seconds: float, since_s: float = 5.0) -> tuple[Step, ...]:
    return do.run(seconds), do.measured("the RMS error", off_track(name, since_s), rms_m)


def begins(name: str, **more: object) -> dict[str, object]:
    """Return the setting of a flight that begins at rest on a track, its nose the way that it will look."""
    x, y, z = position(track(name), np.array([0.0]))[0].tolist()
    psi = degrees(start_yaw(track(name), "by-formula"))
    return {"track": name, "airborne": z, "start": {"x": x, "y": y, "psi": psi}, **more}


def follows_by_its_estimate(sitl: Sitl, max_m: float) -> None:
    where, wanted = sitl.heard("LOCAL_POSITION_NED"), sitl.heard("POSITION_TARGET_LOCAL_NED")
    targets = {message.time_boot_ms: message for message in wanted}
    both = [(message, targets[message.time_boot_ms]) for message in where if message.time_boot_ms in targets]
    off = np.array([(a.x - b.x, a.y - b.y, a.z - b.z) for a, b in both[-50:]])
    assert len(off) == 50
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) <= max_m


@do.word
def circles_at(sitl: Sitl, m_s: float, within_m_s: float) -> None:
    columns = sitl.flown(sitl.time_s - 10.0)
    speed = np.hypot(columns["vx"], columns["vy"])
    assert abs(speed - m_s).max() <= within_m_s


@do.word
def yaw_turns_through(sitl: Sitl, min_deg: float) -> None:
    columns = sitl.flown()
    w, x, y, z = (columns[name] for name in ("qw", "qx", "qy", "qz"))
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    assert degrees(abs(yaw[-1] - yaw[0])) >= min_deg
    assert abs(columns["r"]).max() < 4.0


FAST = "lemniscate:size=4,height=3,lap=2"
CIRCLE = "circle:radius=5,speed=4"

INTERVAL: int = mav.MAV_CMD_SET_MESSAGE_INTERVAL

SCENARIOS = (
    *(
        Scenario(
            name=f"{name}-of-the-thesis",
            peer=f"ours: the thesis has RMS {thesis_m:g} m",
            holds=f"RMS at most {1000.0 * rms_m:g} mm from 20 s on",
            steps=on_track(name, rms_m=rms_m, seconds=25.0, since_s=20.0),
            setting=begins(name),
        )
        for name, thesis_m, rms_m in (
            ("spiral", 0.125, 0.0001),
            ("expanding-spiral", 0.903, 0.0005),
            ("line", 0.058, 0.0001),
            ("wave", 0.805, 0.0005),
            ("crown", 0.339, 0.0005),
        )
    ),
    Scenario(
        name="circle-keeps-its-speed",
        peer="AP CircleSpeed: ± 0.1 m/s for 10 s",
        holds="± 0.01 m/s for 10 s",
        steps=(do.run(15.0), circles_at(4.0, 0.01)),
        setting=begins(CIRCLE),
    ),
    Scenario(
        name="lemniscate",
        peer="ours (PX4 gives no number)",
        holds="RMS at most 2 mm from 10 s on, 4 m in 6 s",
        steps=on_track("lemniscate", rms_m=0.002, seconds=20.0, since_s=10.0),
        setting=begins("lemniscate"),
    ),
    Scenario(
        name="yaw-goes-round",
        peer="ours: no jump at ±180°",
        holds="three turns, yaw rate at most 4 rad/s, RMS at most 5 mm",
        steps=(*on_track("circle", rms_m=0.005, seconds=20.0, since_s=10.0), yaw_turns_through(3.0 * 360.0)),
        setting=begins("circle"),
    ),
    Scenario(
        name="infeasible-speed-saturates",
        peer="ours: saturates, never diverges",
        holds="figure of eight at 20 m/s: error at most 6 m, height at least 1 m, tilt at most 75°",
        steps=(
            do.hold(see.every(see.ARMED, see.above(1.0), see.tilted_less(75.0)), for_=20.0),
            do.measured("the RMS error", off_track(FAST, 5.0), 6.0),
        ),
        setting=begins(FAST),
    ),
    Scenario(
        name="near-gimbal-lock",
        peer="ours: bounded near 90°",
        holds="from 89° pitch: upright within 2 s, at most 3 m lost",
        steps=(
            do.hold(see.above(17.0), for_=2.0),
            do.hold(see.every(see.above(17.0), see.tilted_less(20.0)), for_=3.0),
        ),
        setting={"airborne": 20.0, "start": {"theta": -89.0}},
    ),
    Scenario(
        name="spiral-on-sensors",
        peer="PX4 on jMAVSim 0.032 m, ArduCopter 0.047 m, by their own estimates",
        holds="by its own estimate at most 0.02 m; from the truth 1.2 m",
        steps=(
            lambda sitl: sitl.fly_track("spiral"),
            do.run(28.0),
            *(do.command(INTERVAL, float(number), 8_000.0, result=mav.MAV_RESULT_ACCEPTED) for number in (32, 85)),
            do.run(2.0),
            lambda sitl: follows_by_its_estimate(sitl, 0.05),
        ),
        setting={"feedback": "sensors"},
        seeds=(1, 2),
    ),
    Scenario(
        name="spiral-in-turbulence",
        peer="ours",
        holds="8 m/s and moderate turbulence: RMS at most 0.04 m from 10 s on",
        steps=on_track("spiral", rms_m=0.04, seconds=20.0, since_s=10.0),
        setting=begins("spiral", wind="8@270", turbulence="moderate"),
        seeds=(1, 2, 3),
    ),
    Scenario(
        name="spiral-by-another-control-law",
        peer="ours: the SE(3) baseline",
        holds="RMS at most 0.15 m from 20 s on",
        steps=on_track("spiral", rms_m=0.15, seconds=25.0, since_s=20.0),
        setting=begins("spiral", profile="se3"),
    ),
)
