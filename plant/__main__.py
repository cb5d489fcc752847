"""`colibri plant`: the command line of the plant. It listens on its link before the slow imports."""

import sys
from collections.abc import Sequence
from math import inf

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail
from colibri.common.process.spec import Starter, add_process_options, read_process
from colibri.common.spec import add_options
from colibri.mavlink.links.open import open_ground_link, open_link
from colibri.mavlink.links.startup import awaiting, begin, report_compiling
from colibri.plant.spec import PlantSpec

DEFAULT_LINKS = {
    "colibri": "udpin:127.0.0.1:14560",
    "ardupilot-json": "udpin:127.0.0.1:9002",
    "px4": "tcpin:127.0.0.1:4560",
}


def command_line() -> ArgumentParser:
    parser = ArgumentParser(
        prog="colibri plant",
        description="Simulate a vehicle and its environment. The plant sends the true state or sensor measurements to "
        "the autopilot and receives rotor commands, over MAVLink. It waits for each command (lockstep), unless "
        "--realtime is given. Start `colibri autopilot` in another terminal, before or after.",
        epilog="Example: colibri plant --duration 100 --out out/flight",
    )
    shown = {
        "link": ", ".join(f"{url} for {whom}" for whom, url in DEFAULT_LINKS.items()),
        "start": "y=-1,z=2,psi=90,rotors=4740, all else 0; on sensors y=-1,psi=90",
    }
    add_options(parser, PlantSpec, shown=shown)
    add_process_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    return run_plant(*read_process(PlantSpec, command_line().parse_args(argv)))


def run_plant(spec: PlantSpec, starter: Starter) -> int:
    if spec.realtime and (spec.serve != "colibri" or spec.speed == inf):
        fail("--realtime follows the wall clock for `colibri autopilot`: no --serve beside it, and no --speed max")
    if spec.events and spec.serve != "colibri":
        fail(f"--event needs --serve colibri: {spec.serve} flies wind, gusts and turbulence only")
    url = spec.link or DEFAULT_LINKS[spec.serve]
    if spec.serve == "px4":
        link_to_px4, status, stop = begin("plant", url, starter, open_ground_link)
        event = "listening" if link_to_px4.target is None else "calling"
        status.say(event, awaiting("PX4", link_to_px4), url=link_to_px4.url)
        report_compiling(status)
        from colibri.plant.process.px4_server import run as serve_px4

        return serve_px4(spec, link_to_px4, status, stop)
    link, status, stop = begin("plant", url, starter, open_link)
    if link.target is not None:
        fail(f"{url}: the plant calls PX4 alone; others call it: give --link udpin:HOST:PORT")
    whom = "ArduPilot" if spec.serve == "ardupilot-json" else "an autopilot"
    status.say("listening", awaiting(whom, link), url=link.url)
    report_compiling(status)
    if spec.serve == "ardupilot-json":
        from colibri.plant.process.ardupilot_server import run
    else:
        from colibri.plant.process.server import run

    return run(spec, link, status, stop)


if __name__ == "__main__":
    sys.exit(main())
