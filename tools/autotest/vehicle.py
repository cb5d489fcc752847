"""`python -m tools.autotest.vehicle`: Colibri behind the command line of ArduCopter's SITL binary.

One process, so that a harness can stop and continue it: plant and autopilot of `colibri sitl --identity ardupilot`,
with its TCP server. As ArduCopter's, it keeps its state in the current folder, takes the radio's channels from UDP
port 5501 + 10 N, stands at its start again after a reboot, and its battery never empties.
"""

import os
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from struct import iter_unpack
from time import perf_counter, sleep

from msgspec.structs import replace

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.identities.copter_parameters import rows
from colibri.autopilot.process.ground import GroundService
from colibri.autopilot.process.state_folder import FLIGHT, PLANS
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.earth.home import DEFAULT_HOME, home
from colibri.common.errors import Error, unknown
from colibri.common.files import read_text
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import Stop, gc_frozen, one_line
from colibri.common.process.status import Status
from colibri.flights.flight import InMemory
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.links.open import open_link
from colibri.mavlink.setpoints.radio import Radio
from colibri.plant.physics.start import Start
from colibri.plant.process.server import FramePacer, builder_of
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle

TCP_PORT, RADIO_PORT, PORTS_EACH = 5760, 5501, 10
FEEDBACK = "COLIBRI_FEEDBACK"  # environment variable for what ArduCopter's command line has no option for
_RADIO_BYTES, _FIRST_FRAMES, _ENDLESS_AH = (16, 32), 100, 1e4
_MODELS = ("+", "quad", "x", "X")


def parser() -> ArgumentParser:
    """Return ArduCopter's options, as far as a MAVLink vehicle has them."""
    parser = ArgumentParser(prog="arducopter", description=__doc__, allow_abbrev=False)
    add = parser.add_argument
    add("-w", "--wipe", action="store_true", help="forget saved parameters, plans and logs")
    add("-I", "--instance", type=int, default=0, metavar="N", help="ports 10 N higher")
    add("-O", "--home", type=home, default=DEFAULT_HOME, metavar="LAT,LON,ALT,YAW")
    add("-M", "--model", default="+", help=f"one of {', '.join(_MODELS)}; all fly the profile's vehicle")
    add("-s", "--speedup", type=float, metavar="N", help="times real time (default: SIM_SPEEDUP)")
    add("--defaults", default="", metavar="FILE,...", help="parameter files")
    add("--unhide-groups", action="store_true", help="without effect")
    for name in ("sim-address", "rate", *(f"serial{port}" for port in range(10))):
        add(f"--{name}", metavar="VALUE", help="without effect, but that --serial1=tcp:N serves port 5760 + N")
    return parser


def defaults(text: str) -> dict[str, int | float]:
    """Return the parameters of files, without names that Colibri lacks; Error for a wrong line."""
    kinds, found = {row.name: row.kind for row in rows()}, dict[str, int | float]()
    for file in filter(None, text.split(",")):
        for line in read_text(Path(file)).splitlines():
            name, *values = line.partition("#")[0].replace(",", " ").split() or [""]
            try:
                if name in kinds:
                    found[name] = float(values[0]) if kinds[name] == "f" else round(float(values[0]))
            except (IndexError, ValueError):
                raise Error(f'{file}: expected NAME VALUE, not "{line}"') from None
    return found


class Vehicle:
    """Plant and autopilot in lockstep; after a reboot of the autopilot both begin at time 0."""

    def __init__(self, autopilot: AutopilotSpec, plant: PlantSpec, radio_port: int, speed: float) -> None:
        self._feedback, self._speed = autopilot.feedback, speed
        self._ground = GroundService(autopilot, *autopilot.load(), Status("colibri", as_json=False))
        self._builder = builder_of(plant)
        self._radio, self._channels = open_link(f"udpin:127.0.0.1:{radio_port}"), tuple[int, ...]()
        self._begin()

    def _begin(self) -> None:
        self._autopilot = self._ground.autopilot
        interval_us = self._autopilot.frame_interval_us
        self._plant = self._builder.build(self._feedback, interval_us)
        self._wire = InMemory(interval_us, self._feedback, rotors=self._builder.vehicle.rotors.count)
        self._pacer = FramePacer(self._speed, perf_counter())
        self._listen()

    def step(self) -> None:
        plant, pacer = self._plant, self._pacer
        _, command, asked, *_ = self._wire.exchange(plant, self._autopilot)
        pacer.change(asked, plant.world.time_us, perf_counter())
        plant.answer(command, asked)
        self._listen()
        if self._ground.serve(perf_counter()) is not self._autopilot:
            self._speed = pacer.speed
            self._begin()
        else:
            sleep(max(0.0, pacer.due_s(plant.world.time_us, perf_counter()) - perf_counter()))

    def _listen(self) -> None:
        radio = self._ground.copter.stations.manual
        for datagram, _ in self._radio.receive_now():
            if len(datagram) in _RADIO_BYTES:
                self._channels = tuple(value for (value,) in iter_unpack("<H", datagram))
        if self._channels and isinstance(radio, Radio):
            radio.transmitter = self._channels

    def close(self) -> None:
        self._radio.close()
        self._ground.close()


def main(arguments: Sequence[str] | None = None) -> int:
    args = parser().parse_args(arguments)
    with one_line():
        params = defaults(args.defaults)
        if args.model not in _MODELS:
            raise Error(unknown("model", args.model, _MODELS))
        kept = [Path(FLIGHT), *([Path(PLANS), *Path().glob("*.params")] if args.wipe else [])]
        for file in kept:  # a flight of before would be continued
            file.unlink(missing_ok=True)
        autopilot, plant, radio_port = specs(args, params)
        speed = args.speedup or params.get("SIM_SPEEDUP", 1.0)
        vehicle, stop = Vehicle(autopilot, plant, radio_port, speed), Stop(parent=os.getppid())
        for _ in range(_FIRST_FRAMES):  # the first ones load what flies
            vehicle.step()
        print(f"Waiting for connections to {', '.join(autopilot.gcs)}", flush=True)
        try:
            with gc_frozen():
                while not stop:
                    vehicle.step()
        finally:
            vehicle.close()
    return 0


def specs(args: Namespace, params: Mapping[str, int | float]) -> tuple[AutopilotSpec, PlantSpec, int]:
    """Return the vehicle of a command line, and its port for the radio."""
    first = TCP_PORT + PORTS_EACH * args.instance
    further = [value for number in range(1, 10) if (value := getattr(args, f"serial{number}"))]
    offsets = [0, *(int(value[4:]) for value in further if value.startswith("tcp:") and value[4:].isdecimal())]
    vehicle = load_vehicle(load_profile(AutopilotSpec().profile).simulation.vehicle)
    if vehicle.battery is not None:
        vehicle = replace(vehicle, battery=replace(vehicle.battery, capacity_ah=_ENDLESS_AH))
    autopilot = AutopilotSpec(
        identity="ardupilot",
        vehicle=vehicle,
        home=args.home,
        system_id=args.instance + 1,
        gcs=tuple(f"tcpin:127.0.0.1:{first + offset}" for offset in offsets),
        state=Path(),
        params=params,
        feedback=Feedback(os.environ.get(FEEDBACK, Feedback.STATE)),
    )
    plant = PlantSpec(home=args.home, vehicle=vehicle, start=Start(psi=args.home.yaw_enu_deg)._asdict())
    return autopilot, plant, RADIO_PORT + PORTS_EACH * args.instance


if __name__ == "__main__":
    sys.exit(main())
