"""`colibri plant` and `colibri autopilot`: the two processes, with command lines of their own."""

from collections.abc import Sequence

PROCESSES = {
    "plant": "the vehicle and its world, waiting for an autopilot",
    "autopilot": "the autopilot, calling a plant",
}


def run_process(name: str, options: Sequence[str]) -> int:
    if name == "plant":
        from colibri.plant.__main__ import main
    else:
        from colibri.autopilot.__main__ import main
    return main(options)
