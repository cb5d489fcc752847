"""The subcommands with their descriptions and examples."""

from argparse import Action, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Generator, Iterator, Sequence
from importlib import import_module
from shutil import get_terminal_size
from textwrap import dedent, indent, wrap
from typing import NamedTuple, NoReturn

from colibri.common.process.arguments import ArgumentParser


class CommandEntry(NamedTuple):
    """A subcommand: its function and module; each of the `examples` has a line, with its purpose after a `#`."""

    does: str
    module: str
    function: str
    examples: str

    def load(self) -> Callable[[Namespace], int]:
        run: Callable[[Namespace], int] = getattr(import_module(self.module), self.function)
        return run


_TEXTS = {
    "fly": {
        "fly cli.viewing": """fly a track and report how well it went
            colibri fly spiral                                # report and figures in out/
            colibri fly lemniscate:lap=5 --wind 5@270         # in wind from the west
            colibri fly circle --feedback sensors --seed 3    # on simulated sensors""",
        "sitl cli.viewing": """start a simulated vehicle for QGroundControl, MAVSDK or MAVProxy
            colibri sitl                                      # then start QGroundControl
            colibri sitl --count 3                            # a fleet of three
            colibri sitl --feedback sensors --turbulence light --speed 1""",
        "view cli.viewing": """show flights, or a live MAVLink vehicle, in a browser
            colibri view out/spiral
            colibri view out/spiral out/other    # two flights in one picture
            colibri view udpin:127.0.0.1:14550""",
        "plot cli.viewing": """draw the figures of a recorded flight
            colibri plot out/spiral""",
        "export cli.viewing": """write the topics of a flight's ULog as MCAP, CSV, Parquet or MATLAB
            colibri export out/spiral --mcap           # for Foxglove
            colibri export out/spiral --csv            # a table of each topic""",
        "replay flights.replay": """replay a recorded flight and compare the rotor commands
            colibri replay out/spiral""",
    },
    "many flights": {
        "campaign cli.campaign": """fly every combination of factors with many seeds; write one table
            colibri campaign mass.toml --out out/mass
            colibri campaign mass.toml --out out/mass --resume    # continue it
            colibri campaign --track spiral --set feedback=state,sensors --seeds 1-10""",
        "tune cli.tune": """tune numbers of a profile, and validate them on other seeds
            colibri tune weights.toml --out out/tune
            colibri tune weights.toml --out out/tune --resume     # continue, or join""",
        "compare studies.comparison": """compare control laws on several tracks
            colibri compare --profile flight --profile se3 --track spiral
            colibri compare --track circle --seeds 1-20 --turbulence light""",
        "arena arena.run": """compare control laws with published results on the same tracks
            colibri arena race --law agile --law my_law.py:Law    # cells of SSI-MPC
            colibri arena robust policy --starts 1""",
        "study studies.studies": """fly the studies of profile flight and draw their figures
            colibri study speed robustness    # two of the studies; without a name all""",
        "figures studies.thesis_figures": """fly the thesis's flights and draw its figures
            colibri figures --only 4.9""",
    },
    "other vehicles": {
        "companion companion.process": """fly a vehicle of PX4, ArduPilot or Colibri as its offboard companion
            colibri companion spiral --vehicle udpin:127.0.0.1:14540 --dry-run
            colibri companion circle --vehicle udpin:127.0.0.1:14540 --arm""",
        "vehicle cli.descriptions": """write a new vehicle's file, or parameters of PX4 or ArduPilot
            colibri vehicle new x --mass 2 --arm .25 --propeller 1045 --hover-throttle .5
            colibri vehicle hummingbird --for px4 --out hummingbird.params""",
        "check-vehicle conformance.vehicle_check:command": """fly a vehicle, and find how wrong its numbers may be
            colibri check-vehicle mine.toml
            colibri check-vehicle x500 --controller geometric-se3 --json""",
    },
    "control laws": {
        "check-controller conformance.check:command": """test a control law against the requirements for all laws
            colibri check-controller geometric-se3
            colibri check-controller lpv-mpc --only memory --only limits""",
        "gym gym.export": """describe a learned policy, so that it can fly as a control law
            colibri gym export policy.onnx    # then: fly --controller policy.onnx
            colibri gym export policy.onnx --env colibri/Hover-v0 --set action=rates""",
        "certify certification.report": """compute a Lyapunov certificate of a profile's attitude law
            colibri certify flight --controller lpv-mpc""",
    },
    "profiles and vehicles": {
        "show cli.descriptions": """print the file of a profile or vehicle, to copy and change
            colibri show profile flight > mine.toml
            colibri show vehicle hummingbird"""
    },
    "this computer": {
        "compile cli.compilation": """compile the machine code of flights and tests in advance
            colibri compile           # once after installation, in CI before pytest
            colibri compile flight    # only what a flight with the profile flight needs""",
        "doctor doctor": """check that Colibri can fly on this computer
            colibri doctor
            colibri doctor --gcs    # also test the link to a ground station""",
        "bench bench.run": """measure the speed of control steps and flights
            colibri bench --only commands
            colibri bench --only stages --runs 1""",
        "verify verification.verify": """check that flights are equal bit for bit, twice or to recorded hashes
            colibri verify --link memory""",
        "completion cli.completion": """print a script for command completion in a shell
            colibri completion bash > ~/.local/share/bash-completion/completions/colibri
            colibri completion zsh > ~/.zfunc/_colibri""",
    },
}
"""By purpose: each subcommand with the module of the function of its name, what it does, and its examples."""


def _entries(texts: dict[str, str]) -> Iterator[tuple[str, CommandEntry]]:
    for key, text in texts.items():
        name, _, place = key.partition(" ")
        module, _, function = place.partition(":")
        does, _, examples = text.partition("\n")
        yield name, CommandEntry(does, f"colibri.{module}", function or name, dedent(examples))


GROUPS = {group: dict(_entries(texts)) for group, texts in _TEXTS.items()}
COMMANDS = {name: command for group in GROUPS.values() for name, command in group.items()}
PROCESSES = {
    "plant": "simulate a vehicle, and wait for an autopilot",
    "autopilot": "run the autopilot, and connect it to a plant",
}
"""The two processes of a flight, with command lines of their own."""


_MIN_WIDTH, _MAX_WIDTH = 40, 120
_NAME = 18


class Version(Action):
    """Print the version, which takes time to find, and exit."""

    def __call__(self, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"colibri {version('colibri-sitl')}")
        raise SystemExit(0)


class _Grouped(RawDescriptionHelpFormatter):
    """Help with the subcommands at the end only, in groups."""

    def _iter_indented_subactions(self, _action: Action) -> Generator[Action, None, None]:
        yield from ()


def parser_for(given: Sequence[str]) -> ArgumentParser:
    """Return the parser of a command line: quickly, if it begins with a subcommand."""
    return parser_of(given[0], alone=True) if given and given[0] in COMMANDS else parser_of()


def parser_of(*whole: str, alone: bool = False) -> ArgumentParser:
    """Return the parser with the options of some subcommands, and without the other subcommands if `alone`."""
    parser = ArgumentParser(
        prog="colibri",
        description="A quadrotor autopilot in pure Python, flown over MAVLink.",
        epilog="" if alone else _listed(),
        formatter_class=_Grouped,
    )
    parser.add_argument("--version", action=Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", help="one of the commands below")
    for name in whole if alone else COMMANDS:
        does = COMMANDS[name].does
        examples = f"examples:\n{indent(COMMANDS[name].examples, '  ')}"
        options = commands.add_parser(name, help=does, description=does, epilog=examples)
        options.formatter_class = RawDescriptionHelpFormatter
        if name in whole:
            add_options(name, options)
    for name, does in () if alone else PROCESSES.items():
        commands.add_parser(name, help=does, add_help=False)
    return parser


def _listed() -> str:
    known = {group: {name: it.does for name, it in commands.items()} for group, commands in GROUPS.items()}
    width, lines = min(max(get_terminal_size().columns, _MIN_WIDTH), _MAX_WIDTH), []
    for group, commands in (known | {"the two processes of a flight": PROCESSES}).items():
        lines.append(f"{group}:")
        for name, does in commands.items():
            lines += wrap(does, width - 2, initial_indent=f"  {name:<{_NAME}}", subsequent_indent=" " * (_NAME + 2))
    return "\n".join([*lines, "", "colibri COMMAND --help prints the options and examples of a command."])


def add_options(name: str, parser: ArgumentParser) -> None:
    from colibri.cli import options  # the list of commands does without

    getattr(options, name.replace("-", "_"))(parser)
