"""Parts of `messages.md`: messages and commands of the vehicle."""

import ast
import pkgutil
import re
from collections.abc import Iterator
from importlib import import_module
from inspect import getdoc, getmembers, getsource, isclass

import colibri.mavlink as mavlink_package
from colibri.analysis.tables import markdown
from colibri.autopilot.commander import commands, motion_commands
from colibri.autopilot.ground import stations, system_commands
from colibri.mavlink.mission.service import MissionService, MissionVehicle
from colibri.mavlink.services import standard_modes
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.streaming import service as streaming_service
from colibri.mavlink.streaming.rates import DEFAULTS, GCS, HZ, SDK
from colibri.mavlink.telemetry import attitude, controller, position, power, sensors, status
from colibri.mavlink.wire.dialect import mav
from tools.pages.tables import cell, with_body, with_tables

_TELEMETRY = (attitude, controller, position, power, sensors, status)
_HANDLERS = (commands, motion_commands, stations, streaming_service, standard_modes, system_commands)


def tables() -> list[str]:
    return [
        markdown(("message", "SDK", "GCS", "content"), list(_streamed()), names=4),
        markdown(("messages", "effect"), list(_taken()), names=2),
    ]


def _page(page: str) -> str:
    commands = ", ".join(f"`{name.removeprefix('MAV_CMD_')}` {getattr(mav, name)}" for name in sorted(obeyed()))
    return with_body(with_tables(page, tables()), (f"{commands}.", ""), first="`COMPONENT_ARM", last="## Positions")


def _streamed() -> Iterator[tuple[str, ...]]:
    for name in sorted(DEFAULTS[SDK].keys() | DEFAULTS[GCS].keys()):
        encoder = next(getattr(module, name.lower()) for module in _TELEMETRY if hasattr(module, name.lower()))
        meaning = " ".join((getdoc(encoder) or "").split()).removeprefix(name).lstrip()
        yield f"`{name}`", _rate(SDK, name), _rate(GCS, name), cell(meaning)


def _rate(kind: str, name: str) -> str:
    interval_us = DEFAULTS[kind].get(name)
    return f"{HZ / interval_us:g}" if interval_us else "-"


def _taken() -> Iterator[tuple[str, ...]]:
    by_service: dict[str, list[str]] = {}
    for message, service in sorted(taken().items()):
        by_service.setdefault(service, []).append(f"`{message}`")
    for service, messages in by_service.items():
        yield ", ".join(messages), cell(service)


def taken() -> dict[str, str]:
    found: dict[str, str] = {}
    for info in pkgutil.walk_packages(mavlink_package.__path__, f"{mavlink_package.__name__}."):
        module = import_module(info.name)
        for _, kind in getmembers(module, isclass):
            handles = vars(kind).get("handles")
            if kind.__module__ == module.__name__ and isinstance(handles, frozenset):
                found |= dict.fromkeys(handles, (getdoc(kind) or "").partition("\n\n")[0].replace("\n", " "))
    nowhere = MissionVehicle(*([lambda *_: None] * len(MissionVehicle._fields)))  # type: ignore[arg-type]
    plans = MissionService({}, nowhere, StatusText())
    doc = (getdoc(MissionService) or "").partition(":")[0] + "."
    return found | dict.fromkeys(plans.handles, doc)


def obeyed() -> set[str]:
    found: set[str] = set()
    for module in _HANDLERS:
        tree = ast.parse(getsource(module))
        handlers = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        for node in (part for of in handlers if of.name.strip("_") == "handlers" for part in ast.walk(of)):
            if isinstance(node, ast.Attribute) and node.attr.startswith("MAV_CMD_"):
                found.add(node.attr)
        texts = (str(node.value) for node in ast.walk(tree) if isinstance(node, ast.Constant))
        found |= {text for text in texts if re.fullmatch("MAV_CMD_[A-Z0-9_]+", text)}
    return found


PAGES = {"messages.md": _page}
