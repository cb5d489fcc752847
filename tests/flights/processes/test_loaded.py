"""No flight waits for a compiler: what is compiled is loaded before a vehicle is served."""

import importlib
import pkgutil
import subprocess
import sys

from numba.core.dispatcher import Dispatcher

from colibri import autopilot
from colibri.autopilot.commander.rules.modes import Mode
from tools.harness.copter_flight import CopterFlight


def loaded() -> dict[str, int]:
    """Return how many versions of each kernel of the autopilot are loaded."""
    entries = pkgutil.walk_packages(autopilot.__path__, "colibri.autopilot.")
    modules = [importlib.import_module(entry.name) for entry in entries if not entry.name.endswith("__main__")]
    return {
        f"{module.__name__}.{name}": len(kernel.signatures)
        for module in modules
        for name, kernel in vars(module).items()
        if isinstance(kernel, Dispatcher)
    }


def fly() -> None:
    """Fly in every manner that leads the vehicle otherwise; fail where that loads something."""
    flight = CopterFlight()
    flight.step()
    before = loaded()
    flight.takeoff()
    flight.goto(2.0, 0.0, 3.0)
    flight.run(1.0)
    for mode in (Mode.POSITION, Mode.ALTITUDE, Mode.STABILIZED):
        flight.stick()
        flight.step()
        flight.select(mode)
        flight.stick()
        flight.run(0.1)
    flight.select(Mode.RETURN)
    flight.run(2.0)
    after = loaded()
    more = {name: count for name, count in after.items() if count > before[name]}
    assert not more, f"loaded in flight: {more}"


def test_nothing_is_loaded_in_flight() -> None:
    """In a process of its own: here, other tests have loaded everything."""
    done = subprocess.run([sys.executable, "-m", __name__], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


if __name__ == "__main__":
    fly()
