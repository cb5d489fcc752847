"""The file of a tuned profile: the original's file, comments included, with new numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from colibri.autopilot.control.profile import Profile, ProfileTables
from colibri.campaigns.factors import key_of


def profile_file(base: Profile, text: str | None, tuned: Profile, factors: Sequence[str], origin: Sequence[str]) -> str:
    """Return the file of a tuned profile, verified by reading it back.

    Args:
        text: The file of `base`, if it has one.
        factors: Names of the tuned numbers.
        origin: Lines of the comment at the top.
    """
    import tomlkit

    document: Any = tomlkit.parse(text) if text is not None else tomlkit.parse(tomlkit.dumps(_tables(base)))
    name = tuned_name(base)
    if "name" in document:
        document["name"] = name
    else:
        text = f'name = "{name}"\n{tomlkit.dumps(document)}'
        document = tomlkit.parse(text)
    lines = [*origin, "Tuned numbers, with their original values:"]
    for factor in factors:
        key = key_of(factor)
        if key is None:
            raise KeyError(factor)
        was, now = (profile.value(key.key) for profile in (base, tuned))
        _set(document, key.key, now)
        lines.append(f"  {key.key} = {now}  # {was}")
    written = "".join(f"# {line}\n" for line in lines) + tomlkit.dumps(document)
    _check(written, tuned, name)
    return written


def tuned_name(base: Profile) -> str:
    return f"{base.name.rstrip('*')}-tuned"


def _set(document: Any, key: str, value: Any) -> None:
    *above, last = key.split(".")
    parent = document
    for name in above:
        parent = parent[int(name) if isinstance(parent, list) else name]
    parent[int(last) if isinstance(parent, list) else last] = value


def _tables(profile: Profile) -> Mapping[str, Any]:
    plain = msgspec.to_builtins(profile)
    return {key: _given(plain[key]) for key in ProfileTables.__struct_fields__ if plain[key] is not None}


def _given(value: Any) -> Any:
    """Remove `None`, which TOML does not have."""
    return {key: _given(each) for key, each in value.items() if each is not None} if isinstance(value, dict) else value


def _check(written: str, tuned: Profile, name: str) -> None:
    expected = msgspec.convert({**_tables(tuned), "name": name}, type=ProfileTables)
    if msgspec.toml.decode(written, type=ProfileTables) != expected:
        raise AssertionError("the profile that was written is not the one that was flown")
