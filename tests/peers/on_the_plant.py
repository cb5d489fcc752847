"""PX4 or ArduCopter on our plant, twice: each time it takes off and hovers, and is killed.

`python -m tests.peers.on_the_plant px4|ardupilot PROGRAM FOLDER`, in a network namespace with loopback alone: both
programs bind to all addresses.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from math import nan
from pathlib import Path
from subprocess import STDOUT, Popen, run
from time import monotonic

from colibri.mavlink.client.client import Client
from colibri.mavlink.client.commands import Command, set_message_interval
from colibri.mavlink.client.conversation import Repeat
from colibri.mavlink.client.modes import COPTER_MODES
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, MODE_ARMED, mav

VEHICLES = {"px4": "iris", "ardupilot": "hummingbird"}
SPEED = 5  # times real time: what a computer that is busy with other tests still keeps to
HOVER_S = 15.0
NEARLY_THERE_M = 1.7
TAKE_OFF_M = 2.0  # of ArduPilot; PX4 has MIS_TAKEOFF_ALT, 2.5 m
_GIVE_UP_AFTER_S = 120.0
_ASK_EVERY_US = 200_000
_VEHICLE = (1, AUTOPILOT_COMPONENT)
_COLIBRI = (sys.executable, "-m", "colibri")


def main(whom: str, program: str, folder: Path) -> None:
    with plant(whom, folder, VEHICLES[whom], SPEED) as parameters:
        for number in (1, 2):
            start = px4 if whom == "px4" else arducopter
            with start(Path(program), parameters, folder / f"stack-{number}"):
                hover(whom)


@contextmanager
def plant(whom: str, folder: Path, vehicle: str, speed: float) -> Iterator[Path]:
    parameters = folder / "parameters"
    run([*_COLIBRI, "vehicle", vehicle, "--for", whom, "--out", str(parameters)], check=True)
    served = "px4" if whom == "px4" else "ardupilot-json"
    options = ("--serve", served, "--vehicle", vehicle, "--speed", str(speed), "--out", str(folder / "plant"))
    with (
        (folder / "plant.txt").open("wb") as said,
        Popen([*_COLIBRI, "plant", *options], stdout=said, stderr=STDOUT) as process,
    ):
        try:
            yield parameters
        finally:
            process.terminate()


@contextmanager
def px4(build: Path, parameters: Path, folder: Path) -> Iterator[None]:
    with killed_after(px4_command(build), folder, os.environ | px4_settings(parameters, SPEED)):
        yield


def px4_command(build: Path) -> list[str]:
    return [str(build / "bin" / "px4"), "-d", str(build / "etc"), "-s", "etc/init.d-posix/rcS"]


def px4_settings(parameters: Path, speed: float) -> dict[str, str]:
    """Return PX4's environment: a file of parameters, and what it needs without sticks and ground station."""
    lines = [line.split() for line in parameters.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    given = {f"PX4_PARAM_{name}": value for _, _, name, value, _ in lines}
    others = {"PX4_SIM_MODEL": "none_iris", "PX4_SIM_SPEED_FACTOR": str(speed), "PX4_PARAM_NAV_DLL_ACT": "0"}
    return given | others | {"PX4_PARAM_COM_RCL_EXCEPT": "7"}


@contextmanager
def arducopter(program: Path, parameters: Path, folder: Path) -> Iterator[None]:
    """Start ArduCopter with the parameters as its defaults, all that it has kept forgotten."""
    options = ("--model", "JSON:127.0.0.1", "--speedup", str(SPEED), "-w", "--defaults", str(parameters))
    with killed_after([str(program), *options], folder, dict(os.environ)):
        yield


@contextmanager
def killed_after(command: list[str], folder: Path, environment: dict[str, str]) -> Iterator[None]:
    """Run a program in a folder of its own. ArduCopter heeds nothing but SIGKILL while it waits for its simulator."""
    folder.mkdir()
    with (folder / "said.txt").open("wb") as said:
        process = Popen(command, cwd=folder, env=environment, stdout=said, stderr=STDOUT)
        try:
            yield
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()


def hover(whom: str) -> None:
    """Have it take off, and wait until it has hovered for `HOVER_S` by its own clock."""
    url = "udpin:127.0.0.1:14540" if whom == "px4" else "tcp:127.0.0.1:5760"
    kind = mav.MAV_TYPE_ONBOARD_CONTROLLER if whom == "px4" else mav.MAV_TYPE_GCS
    client, orders = Client(255, 190, kind=kind, heartbeat_every_us=_ASK_EVERY_US), list[Command]()
    up_since_ms, armed, peer, give_up_s = None, False, None, monotonic() + _GIVE_UP_AFTER_S
    with closing(open_ground_link(url)) as link:
        while monotonic() < give_up_s:
            link.wait(0.05)
            now_us = round(monotonic() * 1e6)
            for datagram, sender in link.receive_now():
                peer = sender
                for message in client.receive(datagram, now_us):
                    if message.name == "HEARTBEAT":
                        armed = bool(message.fields.base_mode & MODE_ARMED)
                    elif message.name == "LOCAL_POSITION_NED":
                        now_ms, is_up = message.fields.time_boot_ms, message.fields.z < -NEARLY_THERE_M
                        up_since_ms = (up_since_ms or now_ms) if is_up else None
                        if up_since_ms is not None and now_ms - up_since_ms > 1e3 * HOVER_S:
                            return
            if peer is not None:
                if all(order.result is not None for order in orders):
                    orders = [client.begin(order) for order in wanted(whom, armed=armed, up=up_since_ms is not None)]
                for frame in client.poll(now_us):
                    link.send(frame, link.target or peer)
    raise SystemExit(f"{whom} did not hover within {_GIVE_UP_AFTER_S:.0f} s")


def wanted(whom: str, *, armed: bool, up: bool) -> Iterator[Command]:
    repeat = Repeat(_ASK_EVERY_US, 1)
    yield set_message_interval(_VEHICLE, "LOCAL_POSITION_NED", 1e5, repeat=repeat)
    if not armed:
        if whom == "px4":
            yield Command(_VEHICLE, mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, nan, repeat=repeat)
        else:
            yield Command(_VEHICLE, mav.MAV_CMD_DO_SET_MODE, *COPTER_MODES["Guided"].command, repeat=repeat)
        yield Command(_VEHICLE, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, repeat=repeat)
    elif not up and whom == "ardupilot":
        height = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, TAKE_OFF_M)
        yield Command(_VEHICLE, mav.MAV_CMD_NAV_TAKEOFF, *height, repeat=repeat)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
