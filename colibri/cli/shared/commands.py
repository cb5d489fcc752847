"""The subcommands with their descriptions and examples."""

from typing import NamedTuple


class CommandEntry(NamedTuple):
    """A subcommand.

    Attributes:
        room: Package of its file below `colibri.cli`.
        examples: One a line, each with its purpose after a `#`.
    """

    does: str
    room: str
    examples: str


GROUPS: dict[str, dict[str, CommandEntry]] = {
    "fly": {
        "fly": CommandEntry(
            "fly a track and report how well it went",
            "",
            """
            colibri fly spiral                                # report and figures in out/
            colibri fly lemniscate:lap=5 --wind 5@270         # in wind from the west
            colibri fly circle --feedback sensors --seed 3    # by estimates
            """,
        ),
        "sitl": CommandEntry(
            "stand ready for ground stations: QGroundControl, MAVSDK, MAVProxy",
            "",
            """
            colibri sitl                                      # then start QGroundControl
            colibri sitl --count 3                            # a fleet of three
            colibri sitl --feedback sensors --turbulence light --speed 1
            """,
        ),
        "view": CommandEntry(
            "see flights, or a MAVLink vehicle, fly in a browser",
            "viewer",
            """
            colibri view out/spiral
            colibri view out/spiral out/other    # two flights in one picture
            colibri view udpin:127.0.0.1:14550
            """,
        ),
        "plot": CommandEntry(
            "draw the figures of a flight, however it ended",
            "",
            "colibri plot out/spiral",
        ),
        "export": CommandEntry(
            "write the topics of a flight's ULog as MCAP, CSV or Parquet",
            "",
            """
            colibri export out/spiral --mcap           # for Foxglove
            colibri export out/spiral --csv            # a table of each topic
            """,
        ),
        "replay": CommandEntry(
            "replay a recorded flight, and compare the autopilot's answers", "", "colibri replay out/spiral"
        ),
    },
    "many flights": {
        "campaign": CommandEntry(
            "fly every combination of factors, by many seeds, into one table",
            "campaigns",
            """
            colibri campaign mass.toml --out out/mass
            colibri campaign mass.toml --out out/mass --resume    # go on with it
            colibri campaign --track spiral --set feedback=state,sensors --seeds 1-10
            """,
        ),
        "tune": CommandEntry(
            "tune numbers of a profile, and validate them on other seeds",
            "",
            """
            colibri tune weights.toml --out out/tune
            colibri tune weights.toml --out out/tune --resume     # go on, or join
            """,
        ),
        "compare": CommandEntry(
            "fly several controllers on several tracks, side by side",
            "campaigns",
            """
            colibri compare --profile flight --profile se3 --track spiral
            colibri compare --track circle --seeds 1-20 --turbulence light
            """,
        ),
        "arena": CommandEntry(
            "fly control laws on a set's tracks and disturbances, beside published values",
            "campaigns",
            """
            colibri arena race --law agile --law my_law.py:Law    # cells of SSI-MPC
            colibri arena robust policy --starts 1
            """,
        ),
        "study": CommandEntry(
            "fly the studies of profile flight, and draw them",
            "campaigns",
            "colibri study speed robustness    # two of the studies; without a name all",
        ),
        "figures": CommandEntry(
            "fly the thesis's flights and draw its figures", "campaigns", "colibri figures --only 4.9"
        ),
    },
    "vehicles of others": {
        "companion": CommandEntry(
            "fly a vehicle of PX4, ArduPilot or Colibri as its offboard companion",
            "vehicles",
            """
            colibri companion spiral --vehicle udpin:127.0.0.1:14540 --dry-run
            colibri companion circle --vehicle udpin:127.0.0.1:14540 --arm
            """,
        ),
        "vehicle": CommandEntry(
            "write a new vehicle's file, or parameters of PX4 or ArduPilot",
            "descriptions",
            """
            colibri vehicle new x --mass 2 --arm .25 --propeller 1045 --hover-throttle .5
            colibri vehicle hummingbird --for px4 --out hummingbird.params
            """,
        ),
    },
    "control laws": {
        "check-controller": CommandEntry(
            "check a control law against the requirements on all of them",
            "laws",
            """
            colibri check-controller geometric-se3
            colibri check-controller lpv-mpc --only memory --only limits
            """,
        ),
        "gym": CommandEntry(
            "write a learned policy's inputs and outputs, so that it flies as a control law",
            "laws",
            """
            colibri gym export policy.onnx    # then: fly --controller policy.onnx
            colibri gym export policy.onnx --env colibri/Hover-v0 --set action=rates
            """,
        ),
        "certify": CommandEntry(
            "certify a profile's attitude law",
            "laws",
            "colibri certify flight --controller lpv-mpc",
        ),
    },
    "profiles and vehicles": {
        "show": CommandEntry(
            "print the file of a profile or vehicle, to copy and change",
            "descriptions",
            """
            colibri show profile flight > mine.toml
            colibri show vehicle hummingbird
            """,
        ),
    },
    "this computer": {
        "compile": CommandEntry(
            "compile what flights and flight tests need, beforehand",
            "computer",
            """
            colibri compile           # once after installation, in CI before pytest
            colibri compile flight    # only what a flight with the profile flight needs
            """,
        ),
        "doctor": CommandEntry(
            "look whether everything is there that flights need",
            "computer",
            """
            colibri doctor
            colibri doctor --gcs    # wait for a ground station, too
            """,
        ),
        "bench": CommandEntry(
            "measure how fast it flies",
            "computer",
            """
            colibri bench --only commands
            colibri bench --only stages --runs 1
            """,
        ),
        "verify": CommandEntry(
            "fly a fixed set of flights: is every bit the same, twice, or as it once was?",
            "computer",
            "colibri verify --link memory",
        ),
        "completion": CommandEntry(
            "print a script that completes these commands in a shell",
            "computer",
            """
            colibri completion bash > ~/.local/share/bash-completion/completions/colibri
            colibri completion zsh > ~/.zfunc/_colibri
            """,
        ),
    },
}
"""Subcommands by purpose; a subcommand's name is also that of its file."""
COMMANDS = {name: command for group in GROUPS.values() for name, command in group.items()}
PROCESSES = {
    "plant": "the vehicle and its world, waiting for an autopilot",
    "autopilot": "the autopilot, calling a plant",
}
"""The two processes of a flight, with command lines of their own."""
