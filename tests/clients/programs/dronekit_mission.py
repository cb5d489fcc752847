"""DroneKit: upload a mission, download it, fly it; `python dronekit_mission.py CONNECTION`.

The first item of a list is the home of ArduPilot to DroneKit: it counts and shows only those behind it, and cannot
download an empty list.
"""

import sys
from collections.abc import Callable
from time import monotonic, sleep
from typing import Any

from dronekit import Command, VehicleMode, connect
from pymavlink import mavutil

GIVE_UP_AFTER_S = 60.0
RELATIVE = mavutil.mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT


def item(command: int, latitude_deg: float, longitude_deg: float, height_m: float) -> Command:
    return Command(0, 0, 0, RELATIVE, command, 0, 0, 0, 0, 0, 0, latitude_deg, longitude_deg, height_m)


def wait(condition: Callable[[], bool], what: str) -> None:
    give_up_s = monotonic() + GIVE_UP_AFTER_S
    while not condition():
        if monotonic() > give_up_s:
            sys.exit(f"waited in vain: {what}")
        sleep(0.05)
    say(what)


def say(*words: object) -> None:
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


vehicle: Any = connect(sys.argv[1], wait_ready=True)
commands = vehicle.commands
commands.clear()
commands.add(item(mavutil.mavlink.MAV_CMD_NAV_TAKEOFF, 47.397742, 8.545594, 4.0))
commands.add(item(mavutil.mavlink.MAV_CMD_NAV_WAYPOINT, 47.3978, 8.545594, 4.0))
commands.add(item(mavutil.mavlink.MAV_CMD_NAV_WAYPOINT, 47.397742, 8.545594, 4.0))
commands.add(item(mavutil.mavlink.MAV_CMD_NAV_LAND, 47.397742, 8.545594, 0.0))
commands.upload(timeout=GIVE_UP_AFTER_S)
commands.download()
commands.wait_ready(timeout=GIVE_UP_AFTER_S)
say("downloaded", [command.command for command in commands])
vehicle.armed = True
wait(lambda: vehicle.armed, "armed")
vehicle.mode = VehicleMode("MISSION")
wait(lambda: vehicle.mode.name == "MISSION", "mission")
wait(lambda: commands.next == 3, "last item")
wait(lambda: not vehicle.armed, "landed")
vehicle.close()
