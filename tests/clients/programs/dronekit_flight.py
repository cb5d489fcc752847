"""DroneKit: connect, look, arm, take off, go somewhere, land; `python dronekit_flight.py CONNECTION`."""

import sys
from collections.abc import Callable
from threading import Event
from typing import Any

from dronekit import LocationGlobalRelative, VehicleMode, connect

GIVE_UP_AFTER_S = 60.0


def say(*words: object) -> None:
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


vehicle: Any = connect(sys.argv[1], wait_ready=True)
say("connected", vehicle.mode.name, vehicle.armed, vehicle.gps_0.fix_type, vehicle.battery.level)
say("parameters", len(vehicle.parameters), vehicle.parameters["MIS_TAKEOFF_ALT"])
vehicle.parameters.set("MIS_TAKEOFF_ALT", 4.5, retries=3)
say("set", vehicle.parameters["MIS_TAKEOFF_ALT"])


def when(attribute: str, holds: Callable[[Any], bool]) -> Event:
    """Return what is set once a listener has heard that `holds(value)`."""
    heard = Event()

    def listen(_vehicle: object, _name: str, value: Any) -> None:
        if holds(value):
            heard.set()

    vehicle.add_attribute_listener(attribute, listen)
    return heard


def wait(heard: Event, what: str) -> None:
    if not heard.wait(GIVE_UP_AFTER_S):
        sys.exit(f"waited in vain: {what}")
    say(what)


vehicle.add_message_listener("STATUSTEXT", lambda _vehicle, _name, message: say("text", message.text))
armed = when("armed", lambda value: value is True)
vehicle.armed = True
wait(armed, "armed")
up = when("location.global_relative_frame", lambda place: abs(place.alt - 5.0) < 0.1)
vehicle.simple_takeoff(5.0)
wait(up, "up")
there = when("location.global_relative_frame", lambda place: abs(place.lat - 47.3978) < 2e-6 and place.alt > 5.9)
vehicle.simple_goto(LocationGlobalRelative(47.3978, 8.5456, 6.0), groundspeed=4.0)
wait(there, "there")
landed = when("armed", lambda value: value is False)
vehicle.mode = VehicleMode("LAND")
wait(landed, "landed")
vehicle.close()
