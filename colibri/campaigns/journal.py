"""The journal of a campaign: a line per finished flight."""

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager
from importlib.metadata import version
from inspect import getsource
from pathlib import Path
from typing import IO, Any

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import controller_names, origin_of, origin_of_factory
from colibri.campaigns.definition import Campaign
from colibri.campaigns.factors import CampaignError, shown
from colibri.campaigns.flights import Common, FlightResult
from colibri.common.config import UNREADABLE
from colibri.common.files import read_bytes, regular
from colibri.flights.provenance import hash_of

IDENTITY, JOURNAL = "campaign.json", "journal.jsonl"


class Journal(AbstractContextManager["Journal"]):
    def __init__(self, folder: Path, kept: dict[int, FlightResult], file: str = JOURNAL) -> None:
        self.kept = kept
        self._folder = folder
        self._file: IO[bytes] = open(folder / file, "ab", opener=regular)  # noqa: SIM115

    def add(self, flown: FlightResult) -> None:
        """Write a flight's logs, then its line, to disk."""
        keep_files(self._folder, flown)
        kept = flown._replace(files={})
        self._file.write(msgspec.json.encode(kept[:-1]) + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self.kept[flown.flight] = kept

    def __exit__(self, *_: object) -> None:
        self._file.close()


def open_journal(folder: Path, campaign: Campaign, common: Common, *, resume: bool) -> Journal:
    there = claim(folder / IDENTITY, identity_of(campaign, common), "campaign")
    kept = {each.flight: each for each in read_journal(folder / JOURNAL)}
    if there and not resume:
        raise CampaignError(
            f"--out {folder} has {len(kept)} of the {campaign.flights} flights of this campaign: "
            "continue with --resume, or choose another folder"
        )
    return Journal(folder, kept)


def claim(path: Path, identity: Mapping[str, Any], called: str) -> bool:
    """Write an identity into its folder; return whether it was there."""
    folder, scratch = path.parent, path.with_suffix(".new")
    now = msgspec.json.encode(identity)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            if any(entry != scratch for entry in folder.iterdir()):
                raise CampaignError(
                    f"--out {folder} is not empty and does not contain a {called}: choose another folder"
                )
            with scratch.open("wb") as file:
                file.write(msgspec.json.format(now, indent=1) + b"\n")
                file.flush()
                os.fsync(file.fileno())
            scratch.replace(path)
            return False
        was, wanted = (msgspec.json.decode(content, type=dict[str, Any]) for content in (read_bytes(path), now))
    except (OSError, *UNREADABLE) as error:
        raise CampaignError(f"cannot use --out {folder}: {error}") from error
    if was != wanted:
        differs = ", ".join(sorted(name for name in {*was, *wanted} if was.get(name) != wanted.get(name)))
        raise CampaignError(f"--out {folder} has another {called} ({differs} differ): choose another folder")
    return True


def identity_of(campaign: Campaign, common: Common) -> dict[str, Any]:
    """Return the inputs as plain data, files by their hashes."""
    objects = (value for value in campaign.values("profile") if isinstance(value, Profile))
    own = {profile.controller for profile in (*common.profiles.values(), *objects)}
    laws = [*filter(None, campaign.values("controller")), *own.intersection(controller_names())]
    contents = {
        "profiles": common.profiles,
        "vehicles": common.vehicles,
        "winds": {name: repr(blows) for name, blows in common.winds.items()},
        "track_files": common.track_files,
        "laws": {shown(law): origin_of(law) if isinstance(law, str) else _origin(law) for law in laws},
        "tracks": {shown(each): _origin(each) for each in campaign.values("track") if not isinstance(each, str)},
        "metrics": [_origin(metric.of) for metric in campaign.metrics if metric.of is not None],
    }
    return {
        "colibri": version("colibri-sitl"),
        "name": campaign.name,
        "flights": campaign.flights,
        "seeds": list(campaign.seeds),
        "root_seed": campaign.root_seed,
        "paired": campaign.paired,
        "metrics": [metric.name for metric in campaign.metrics],
        "logs": campaign.logs,
        "fly": {name: shown(value) for name, value in campaign.fly.items()},
        "grid": {name: list(map(shown, values)) for name, values in campaign.grid.items()},
        "draw": {name: [type(draw).__name__, repr(draw)] for name, draw in campaign.draw.items()},
        "contents": {name: hash_of(content) for name, content in contents.items() if content},
        "objects": hash_of(_plain([campaign.fly, campaign.grid])),
    }


def _origin(law: Any) -> Any:
    try:
        return [*origin_of_factory(law), getsource(law)]
    except (OSError, TypeError):
        return origin_of_factory(law)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value if isinstance(value, msgspec.Struct | str | int | float | None) else shown(value)


def read_journal(path: Path) -> list[FlightResult]:
    """Read the flights of a journal, and cut off an incomplete last line."""
    if not path.exists():
        return []
    with open(path, "r+b", opener=regular) as file:
        content = file.read()
        whole = content.rfind(b"\n") + 1
        file.truncate(whole)
    kept = []
    for number, line in enumerate(content[:whole].splitlines(), start=1):
        try:
            kept.append(msgspec.json.decode(line, type=FlightResult))
        except UNREADABLE as error:
            raise CampaignError(
                f"{path}: line {number}: {error}: remove the line, its flight is flown again"
            ) from error
    return kept


def keep_files(folder: Path, flown: FlightResult) -> None:
    for name, content in flown.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
