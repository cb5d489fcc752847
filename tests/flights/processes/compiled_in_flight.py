"""Prints which kernels are loaded or compiled only in flight, where that would hold the vehicle up: none should be.

A program of its own: within another test's process all might be loaded already.
"""

import importlib
import pkgutil
import sys
from math import nan

from numba.core.dispatcher import Dispatcher

from colibri import autopilot, plant
from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED


def versions() -> dict[str, int]:
    """Return of each kernel how many versions are loaded."""
    folders = (pkgutil.walk_packages(each.__path__, f"{each.__name__}.") for each in (autopilot, plant))
    names = [entry.name for entries in folders for entry in entries if not entry.name.endswith("__main__")]
    found = [kernel for name in names for kernel in vars(importlib.import_module(name)).values()]
    return {str(kernel): len(kernel.signatures) for kernel in found if isinstance(kernel, Dispatcher)}


def fly(flight: Sitl) -> None:
    flight.takeoff()
    flight.goto(5.0, 0.0, 3.0, wait=False)
    flight.run(1.0)
    attitude = (0, 1, 1, 0b0000_0111, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.5)
    velocity = (0, 1, 1, mav.MAV_FRAME_LOCAL_NED, 0b1101_1100_0111, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0, 0)
    for name, fields in (("SET_POSITION_TARGET_LOCAL_NED", velocity), ("SET_ATTITUDE_TARGET", attitude)):
        flight.send(name, *fields)
        flight.run(0.1)
        flight.select(Mode.OFFBOARD)
        flight.run(0.3, lambda name=name, fields=fields: flight.send(name, *fields))  # type: ignore[misc]
    flight.stick()
    for mode in (Mode.POSITION, Mode.ALTITUDE, Mode.STABILIZED):
        flight.step()
        flight.select(mode)
        flight.stick()
        flight.run(0.1)
    flight.send("MANUAL_CONTROL", 1, 200, 200, 500, 200, 0)
    flight.run(0.1)
    for mode in (Mode.POSITION, Mode.ALTITUDE, Mode.STABILIZED, Mode.TRACK, Mode.HOLD):
        flight.select(mode)
        flight.run(0.3, lambda: flight.send("MANUAL_CONTROL", 1, 200, 200, 500, 200, 0))
    assert flight.command(mav.MAV_CMD_DO_ORBIT, 3.0, 1.0, 0.0, nan, nan, nan, nan) == ACCEPTED
    flight.run(0.3)
    flight.select(Mode.RETURN)
    flight.run(2.0)


def main() -> None:
    with Flights(setting_of([]), None) as flights:
        flight = flights.begin(turbulence="light", ready=False)
        before = versions()
        fly(flight)
    for name, count in versions().items():
        if count > before[name]:
            sys.stdout.write(f"{name}: {before[name]} at first, {count} in the end\n")


if __name__ == "__main__":
    main()
