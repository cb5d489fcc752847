"""The file of a tuned profile: that of the profile it was made of, comments and all, with other numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from colibri.autopilot.control.profile import Profile, ProfileError, ProfileTables
from colibri.campaigns.factors import key_of
from colibri.common.config import value_at


def profile_file(base: Profile, text: str | None, tuned: Profile, factors: Sequence[str], origin: Sequence[str]) -> str:
    """Return the file of a tuned profile, which is read back as just that.

    Args:
        base: The profile as it was.
        text: Its file; None for one that has none.
        tuned: The profile with other numbers.
        factors: Which of them are others.
        origin: Where it comes from, in lines of a comment.
    """
    import tomlkit

    document: Any = tomlkit.parse(text) if text is not None else tomlkit.parse(tomlkit.dumps(_tables(base)))
    name = tuned_name(base)
    if "name" in document:
        document["name"] = name
    else:
        text = f'name = "{name}"\n{tomlkit.dumps(document)}'
        document = tomlkit.parse(text)
    lines = [*origin, "Tuned, and what it was:"]
    for factor in factors:
        key = key_of(factor)
        if key is None:
            raise KeyError(factor)
        was, now = (value_at(profile, key.key, ProfileError) for profile in (base, tuned))
        _set(document, key.key, now)
        lines.append(f"  {key.key} = {now}  # {was}")
    written = "".join(f"# {line}\n" for line in lines) + tomlkit.dumps(document)
    _check(written, tuned, name)
    return written


def tuned_name(base: Profile) -> str:
    """Return what a tuned profile is called."""
    return f"{base.name.rstrip('*')}-tuned"


def _set(document: Any, key: str, value: Any) -> None:
    """Set what a document has at a dotted key, as `Profile.replace` has them."""
    *above, last = key.split(".")
    parent = document
    for name in above:
        parent = parent[int(name) if isinstance(parent, list) else name]
    parent[int(last) if isinstance(parent, list) else last] = value


def _tables(profile: Profile) -> Mapping[str, Any]:
    """Return what a profile's file would have."""
    plain = msgspec.to_builtins(profile)
    return {key: _given(plain[key]) for key in ProfileTables.__struct_fields__ if plain[key] is not None}


def _given(value: Any) -> Any:
    """Return a table without what is None, which TOML does not have."""
    return {key: _given(each) for key, each in value.items() if each is not None} if isinstance(value, dict) else value


def _check(written: str, tuned: Profile, name: str) -> None:
    """Check that what is written is what was flown."""
    expected = msgspec.convert({**_tables(tuned), "name": name}, type=ProfileTables)
    if msgspec.toml.decode(written, type=ProfileTables) != expected:
        raise AssertionError("the profile that was written is not the one that was flown")
