"""Take off and land with pymavlink alone. Start a vehicle first: `colibri sitl`.

Prints:
    connected
    at 3 m
    landed
"""

import os
import sys

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported
from pymavlink import mavutil

link = mavutil.mavlink_connection(sys.argv[1] if len(sys.argv) > 1 else "udpin:127.0.0.1:14550", source_system=255)
link.mav.heartbeat_send(6, 8, 0, 0, 0)  # a ground station; a link that waits answers whoever speaks
if link.wait_heartbeat(timeout=10) is None:
    sys.exit("no vehicle within 10 s: is `colibri sitl` running? Its first start compiles for a minute.")
print("connected")
mav = mavutil.mavlink


def command(number, *values):
    link.mav.command_long_send(link.target_system, link.target_component, number, 0, *values, *[0] * (7 - len(values)))
    answer = link.recv_match(type="COMMAND_ACK", condition=f"COMMAND_ACK.command=={number}", blocking=True, timeout=5)
    if answer is None or answer.result != mav.MAV_RESULT_ACCEPTED:
        sys.exit(f"command {number} refused: {answer}")


home_m = link.recv_match(type="GLOBAL_POSITION_INT", blocking=True).alt / 1000
command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
command(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, float("nan"), float("nan"), float("nan"), home_m + 3)
while link.recv_match(type="GLOBAL_POSITION_INT", blocking=True).relative_alt < 2800:  # mm
    pass
print("at 3 m")
command(mav.MAV_CMD_NAV_LAND)
link.motors_disarmed_wait()
print("landed")
