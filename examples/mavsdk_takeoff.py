"""Take off and land by MAVSDK 4 (`pip install mavsdk`). Start a vehicle first: `colibri sitl`.

Prints:
    connected
    at 3 m
    landed
"""

import sys
from time import sleep

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.telemetry import Telemetry

mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
mavsdk.add_any_connection(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14540")
vehicle = mavsdk.first_autopilot(10.0)
if vehicle is None:
    sys.exit("no vehicle within 10 s: is `colibri sitl` running? Its first start compiles for a minute.")
print("connected")
action, telemetry = Action(vehicle), Telemetry(vehicle)
while not telemetry.health_all_ok():
    sleep(0.1)
action.set_takeoff_altitude(3.0)
action.arm()
action.takeoff()
while not telemetry.position().relative_altitude_m > 2.8:  # nan until one is received
    sleep(0.1)
print("at 3 m")
action.land()
while telemetry.armed():
    sleep(0.1)
print("landed")
mavsdk.destroy()
