"""`colibri autopilot`: the command line of the autopilot."""

import sys
from collections.abc import Sequence
from dataclasses import replace

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.spec import Starter, add_process_options, read_process
from colibri.common.spec import add_options
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.links.link import BlockingReceiver
from colibri.mavlink.links.open import open_ground_link, open_link
from colibri.mavlink.links.startup import begin, report_compiling
from colibri.mavlink.links.udp import UdpLink


def command_line() -> ArgumentParser:
    parser = ArgumentParser(
        prog="colibri autopilot",
        description="Run the autopilot. It receives the true state or sensor measurements from a plant and answers "
        "with rotor commands, over MAVLink. Start `colibri plant` in another terminal, before or after.",
        epilog="Example: colibri autopilot --track spiral",
    )
    add_options(parser, AutopilotSpec)
    add_process_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the autopilot of a command line; return the exit code."""
    return run_autopilot(*read_process(AutopilotSpec, command_line().parse_args(argv)))


def run_autopilot(spec: AutopilotSpec, starter: Starter) -> int:
    """Run an autopilot; return the exit code."""
    link: UdpLink | BlockingReceiver
    if spec.simulator is None:
        link, status, stop = begin("autopilot", spec.plant, starter, open_link)
    else:
        simulator, status, stop = begin("autopilot", spec.simulator, starter, open_ground_link)
        spec, link = replace(spec, feedback=Feedback.SENSORS), BlockingReceiver(simulator)
    report_compiling(status)
    from colibri.autopilot.process.run import run

    return run(spec, link, status, stop)


if __name__ == "__main__":
    sys.exit(main())
