"""The flights of `colibri compare`: contenders, which are profiles with controllers told apart by name, on tracks."""

import argparse
from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import NamedTuple
from urllib.parse import quote

from colibri.autopilot.control.loop import build_controller
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.flights.plan import OPTIONS, FlightPlan

DEFAULT_PROFILES = ("thesis", "thesis-euler", "thesis:global-lpv-mpc", "se3")
_MAX_NAME = 200


class Contender(NamedTuple):
    """A profile with a controller.

    Attributes:
        profile: Name or file.
        controller: None for the profile's.
        name: What tables and folders call it.
    """

    profile: str
    controller: str | None
    name: str


class Job(NamedTuple):
    """One flight of a comparison.

    Attributes:
        contender: Who flies.
        track: What.
        seed: Of everything random.
        args: The command line.
    """

    contender: Contender
    track: str
    seed: int
    args: argparse.Namespace

    @property
    def folder(self) -> Path:
        """Where its logs go, if they are kept."""
        name = f"{quote(self.contender.name.replace(':', '-'), safe='')}-{folder_name(self.track)}"
        if len(name) > _MAX_NAME:
            name = f"{name[:_MAX_NAME]}-{sha256(name.encode()).hexdigest()[:8]}"
        return Path(self.args.out) / "flights" / name

    def plan(self, out: Path) -> FlightPlan:
        """Return the flight as a plan with its logs in `out`."""
        options = {name: getattr(self.args, name) for name in OPTIONS} | {"seed": self.seed, "link": self.args.link}
        return FlightPlan.of_options(
            out,
            **options,
            track=self.track,
            profile=self.contender.profile,
            controller=self.contender.controller,
        )


def folder_name(track: str) -> str:
    """Return a track's name with its options as the name of a folder, one that no other track has."""
    return quote(track.replace(":", "-", 1), safe="=,")


def jobs_of(args: argparse.Namespace) -> list[Job]:
    """Return the flights that a command line asks for, contender by contender.

    Raises:
        Error: One of them cannot begin.
    """
    tracks = dict.fromkeys(args.track or THESIS_TRACKS)
    seeds = args.seeds or (args.seed,)
    contenders = contenders_of(args.profile or DEFAULT_PROFILES, args.controller)
    jobs = [Job(contender, track, seed, args) for contender in contenders for track in tracks for seed in seeds]
    for job in jobs[:: len(seeds)]:
        plan = job.plan(job.folder)
        build_controller(plan.profile, plan.vehicle, perf_counter)
    return jobs


def contenders_of(profiles: Sequence[str], controllers: Sequence[str] | None = None) -> list[Contender]:
    """Return contenders, each once, by `NAME[:CONTROLLER]`, those without one with each of `controllers`.

    A file of its own name is called by that; where two would be called alike, by its path.

    Raises:
        ProfileError: There is no such profile.
    """
    given: dict[tuple[str, str | None], None] = {}
    for text in profiles:
        profile, _, controller = (text, "", "") if text.endswith(".toml") else text.rpartition(":")
        choices: Sequence[str | None] = [controller] if controller and profile else controllers or [None]
        given |= dict.fromkeys((profile or text, choice) for choice in choices)
    names = [load_profile(profile).name for profile, _ in given]
    called = Counter({(name, profile) for name, (profile, _) in zip(names, given, strict=True)})
    twice = Counter(name for name, _ in called)
    found = []
    for name, (profile, law) in zip(names, given, strict=True):
        own = profile if twice[name] > 1 else name
        found.append(Contender(profile, law, f"{own}:{law}" if law else own))
    return found
