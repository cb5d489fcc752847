"""Contenders: profiles with controllers, distinguished by name, and their folders."""

from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from urllib.parse import quote

from colibri.autopilot.control.profile import load_profile

DEFAULT_PROFILES = ("thesis", "thesis-euler", "thesis:global-lpv-mpc", "se3")
_MAX_NAME = 200


def folder_of(contender: str, track: str) -> str:
    name = f"{quote(contender.replace(':', '-'), safe='')}-{folder_name(track)}"
    return name if len(name) <= _MAX_NAME else f"{name[:_MAX_NAME]}-{sha256(name.encode()).hexdigest()[:8]}"


def folder_name(track: str) -> str:
    return quote(track.replace(":", "-", 1), safe="=,")


def contenders_of(profiles: Sequence[str], controllers: Sequence[str] | None = None) -> dict[str, dict[str, str]]:
    """Return the levels of a campaign's factor from `NAME[:CONTROLLER]`.

    A level has the profile's name, or its path where names coincide.
    """
    given: dict[tuple[str, str | None], None] = {}
    for text in profiles:
        head, toml, tail = text.partition(".toml")
        profile, _, controller = (head + toml, "", tail[1:]) if toml else text.partition(":")
        choices: Sequence[str | None] = [controller] if controller and profile else controllers or [None]
        given |= dict.fromkeys((profile or text, choice) for choice in choices)
    names = [load_profile(profile).name for profile, _ in given]
    called = Counter({(name, profile) for name, (profile, _) in zip(names, given, strict=True)})
    twice = Counter(name for name, _ in called)
    found = {}
    for name, (profile, law) in zip(names, given, strict=True):
        own = profile if twice[name] > 1 else name
        found[f"{own}:{law}" if law else own] = {"profile": profile} | ({"controller": law} if law else {})
    return found
