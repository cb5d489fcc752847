"""`make soak-clients`: two ground stations and a companion on one vehicle."""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any, NamedTuple

import psutil

from colibri import plant
from tools.harness.ports import OnPort
from tools.harness.processes import vehicle
from tools.harness.stations import CirclingCompanion, HarnessStation

MAX_GAP_S = 1.5
MAX_GROWTH_BYTES = 2_000_000
MAX_ERROR_M = 0.5
WARM_UP_S = 60.0
LOOK_EVERY_S = 5.0

_VEHICLE = Path(plant.__file__).parent / "vehicle" / "models" / "hummingbird.toml"


class Look(NamedTuple):
    wall_s: float
    sim_s: float
    resident_bytes: dict[str, int]
    cpu_s: dict[str, float]


def crew() -> tuple[HarnessStation, HarnessStation, CirclingCompanion]:
    return HarnessStation(255), HarnessStation(254), CirclingCompanion(245)


def faults(crew: Iterable[HarnessStation]) -> list[str]:
    found = []
    for client in crew:
        name = f"{client.identity[0]}/{client.identity[1]}"
        if client.max_gap_s > MAX_GAP_S:
            found.append(f"{name}: {client.max_gap_s:.2f} s without a heartbeat")
        found += [f"{name}: got {ack} of another" for ack in client.acks if ack.target != client.identity]
        acknowledged = sum(client.acks.values())
        if not sum(client.sent.values()) - 2 <= acknowledged <= sum(client.sent.values()):
            found.append(f"{name}: {acknowledged} of {sum(client.sent.values())} commands acknowledged")
        if isinstance(client, CirclingCompanion) and not 0.0 < client.off_m < MAX_ERROR_M:
            found.append(f"{name}: {client.off_m:.2f} m off its circle")
    return found


def without_battery(folder: Path) -> Path:
    """Write the Hummingbird's file without its battery."""
    path = folder / "tireless.toml"
    path.write_text(_VEHICLE.read_text(encoding="utf-8").partition("[battery]")[0], encoding="utf-8")
    return path


def soak(duration_s: float) -> tuple[dict[str, Any], list[str]]:
    clients = crew()
    with TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        links = tuple(stack.enter_context(OnPort(client)).url for client in clients)
        tireless = ("--vehicle", str(without_battery(folder)))
        flown = stack.enter_context(vehicle(folder, *tireless, links=links))
        processes = {child.cmdline()[3]: child for child in psutil.Process(flown.process.pid).children()}
        looks: list[Look] = []
        began_s = monotonic()
        while monotonic() < began_s + duration_s and flown.process.poll() is None:
            sleep(LOOK_EVERY_S)
            resident = {name: process.memory_info().rss for name, process in processes.items()}
            cpu_s = {name: sum(process.cpu_times()[:2]) for name, process in processes.items()}
            looks.append(Look(monotonic() - began_s, clients[0].time_s, resident, cpu_s))
        ended = flown.process.poll()
    warm = next(look for look in looks if look.wall_s >= min(WARM_UP_S, 0.5 * duration_s))
    figures = _figures(clients, looks, warm)
    wrong = faults(clients) + ([] if ended is None else [f"the vehicle ended with exit code {ended}"])
    for name, growth in figures["growth_bytes"].items():
        if growth > MAX_GROWTH_BYTES:
            wrong.append(f"{name} grew by {growth} bytes")
    return figures, wrong


def _figures(clients: Sequence[HarnessStation], looks: Sequence[Look], warm: Look) -> dict[str, Any]:
    last = looks[-1]
    lasted_s = last.wall_s - warm.wall_s
    return {
        "wall_s": last.wall_s,
        "times_real_time": (last.sim_s - warm.sim_s) / lasted_s,
        "resident_bytes": last.resident_bytes,
        "growth_bytes": {name: last.resident_bytes[name] - warm.resident_bytes[name] for name in last.resident_bytes},
        "cpu_share": {name: (last.cpu_s[name] - warm.cpu_s[name]) / lasted_s for name in last.cpu_s},
        "clients": {
            f"{client.identity[0]}/{client.identity[1]}": {
                "max_gap_s": client.max_gap_s,
                "commands": sum(client.sent.values()),
                "acks": sum(client.acks.values()),
                "messages": sum(client.counts.values()),
            }
            for client in clients
        },
        "off_m": max(client.off_m for client in clients if isinstance(client, CirclingCompanion)),
        "looks": looks,
    }


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.soak.clients", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--out", type=Path, help="write all figures as JSON there")
    args = parser.parse_args()
    figures, wrong = soak(60.0 * args.minutes)
    if args.out:
        args.out.write_text(json.dumps(figures, indent=1), encoding="utf-8")
    figures.pop("looks")
    print(json.dumps(figures, indent=1), *wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
