"""Words for flights of identity `ardupilot`: what ArduPilot's tests wait for, hold and send."""

from collections.abc import Callable
from math import degrees, hypot

from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl

ACCEPTED, DENIED, FAILED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED, mav.MAV_RESULT_FAILED
GLOBAL, RELATIVE = mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
LOCAL = mav.MAV_FRAME_LOCAL_NED
STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, LAND, BRAKE = 0, 2, 3, 4, 5, 6, 7, 9, 17
STANDARD = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800)
Check = Callable[[Sitl], object]


def shown(sitl: Sitl) -> int:
    return int(sitl.gcs.latest("HEARTBEAT").custom_mode)


def in_mode(sitl: Sitl, number: int, within: float = 5.0) -> None:
    sitl.wait_until(lambda: shown(sitl) == number, within=within, what=f"mode {number}")


def says(sitl: Sitl, words: str, within: float = 20.0) -> None:
    sitl.wait_until(lambda: any(words in text for text in sitl.gcs.texts), within=within, what=words)


def both(sitl: Sitl, number: int, *params: float, z: float = 0.0) -> tuple[int, int]:
    """Send a command as COMMAND_LONG and as COMMAND_INT."""
    p = (*params, *(0.0,) * (4 - len(params)))
    return (sitl.gcs.order(number, *p, 0.0, 0.0, z), sitl.gcs.order_int(number, *p, frame=RELATIVE, x=0, y=0, z=z))


def reaches(sitl: Sitl, fact: Callable[[], bool], seconds: float, within: float, what: str) -> None:
    """Fly on until a fact has held for some time."""
    since_us = sitl.time_us
    end = sitl.time_us + round(within * 1e6)
    while sitl.time_us - since_us < seconds * 1e6:
        sitl.step()
        assert sitl.time_us < end, f"{what} for {seconds} s: {sitl.position} {sitl.velocity}"
        if not fact():
            since_us = sitl.time_us


def speeds(sitl: Sitl, tolerance: float, seconds: float, *wanted: float) -> None:
    for speed in wanted:
        near = lambda speed=speed: abs(ground_speed(sitl) - speed) < tolerance  # noqa: E731
        reaches(sitl, near, seconds, 60.0, f"{speed} m/s")


def radio(sitl: Sitl, **channels: int) -> None:
    """Override channels, as c3=1500."""
    values = [channels.get(f"c{number}", 65535) for number in range(1, 9)]
    more = [channels.get(f"c{number}", 0) for number in range(9, 19)]
    sitl.send("RC_CHANNELS_OVERRIDE", 1, 1, *values, *more)


def steered(sitl: Sitl, seconds: float, **channels: int) -> None:
    for _ in range(round(seconds * 2)):
        radio(sitl, **channels)
        sitl.run(0.5)


def height(sitl: Sitl) -> float:
    return sitl.position[2]


def ground_speed(sitl: Sitl) -> float:
    return hypot(*sitl.velocity[:2])


def heading(sitl: Sitl) -> float:
    """Return the heading, degrees clockwise from north."""
    return (90.0 - degrees(sitl.euler[2])) % 360.0


def near_angle(a: float, b: float, tolerance: float = 5.0) -> bool:
    return abs((a - b + 180.0) % 360.0 - 180.0) <= tolerance


def home_and_disarmed(sitl: Sitl, within: float = 250.0) -> None:
    sitl.wait_until(lambda: not sitl.armed, within=within, what="the landing")
    assert height(sitl) < 1.0
    assert hypot(*sitl.position[:2]) < 10.0


def rtl(sitl: Sitl) -> None:
    sitl.select("RTL")
    home_and_disarmed(sitl)


def upload(sitl: Sitl, *plan: items.Item) -> None:
    sitl.upload_mission(plan)


def in_auto(sitl: Sitl) -> None:
    sitl.select("AUTO")
    sitl.arm()
    sitl.gcs.command(mav.MAV_CMD_MISSION_START)
