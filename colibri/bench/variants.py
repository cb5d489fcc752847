"""Profile `flight` with other numbers, and flights with it."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from colibri.autopilot.control.profile import Profile, ProfileTables
from colibri.flights.plan import FlightPlan

CONTROLLER = "whole-lpv-mpc"
TRACK = "lemniscate"


def with_blocks(profile: Profile, blocks: Sequence[int]) -> Profile:
    """Return the profile with another horizon: steps that each planned correction is held for."""
    table = profile.table(CONTROLLER)
    return _with_table(profile, {**table, "plan": {**table["plan"], "blocks": list(blocks)}})


def with_intervals(profile: Profile, *, frame_s: float, control_s: float) -> Profile:
    """Return the profile at other rates."""
    simulation = msgspec.structs.replace(profile.simulation, frame_interval_s=frame_s)
    changed = _with_table(profile, {**profile.table(CONTROLLER), "control_interval_s": control_s})
    return msgspec.structs.replace(changed, simulation=simulation)


def plan_of(profile: Profile, folder: Path, duration_s: float, link: str) -> FlightPlan:
    """Return the plan of a lemniscate with `profile`, which is written into `folder` for processes to read."""
    file = folder / "profile.toml"
    tables = {key: msgspec.to_builtins(getattr(profile, key)) for key in ProfileTables.__struct_fields__}
    file.write_text("\n".join(toml_lines(tables)) + "\n", encoding="utf-8")
    return replace(FlightPlan.of_options(folder, track=TRACK, profile=str(file), link=link), duration_s=duration_s)


def toml_lines(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield tables of numbers, text and lists as TOML; what is None is left out."""
    if path:
        yield f"[{'.'.join(path)}]"
    for key, value in table.items():
        if value is not None and not isinstance(value, Mapping):
            yield f"{key} = {json.dumps(value)}"
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from toml_lines(value, (*path, key))


def _with_table(profile: Profile, table: Mapping[str, Any]) -> Profile:
    return msgspec.structs.replace(profile, controllers={**profile.controllers, CONTROLLER: dict(table)})
