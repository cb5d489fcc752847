"""One flight of two real processes under fire, and what must hold after it."""

import signal
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil

from tests.fuzz.relay import FuzzingRelay
from tests.runs import Process, fly, running, start_plant, states, wait_for

FRAMES_PER_S = 10
MOST_GROWTH_MIB = 8.0


class Outcome(NamedTuple):
    """What a campaign came to.

    Attributes:
        sent: Bad datagrams sent, by whom they were for and of which kind.
        lost: Datagrams that the kernel dropped because a receiver was too slow.
        growth_mib: Resident memory gained between a tenth of the flight and its end, by process.
        failures: What did not hold, in words.
    """

    sent: dict[tuple[str, str], int]
    lost: int
    growth_mib: dict[str, float]
    failures: list[str]


def campaign(folder: Path, quota: int, *, burst: int, seed: int) -> Outcome:
    """Fly until `quota` datagrams of each kind were sent to each process; compare with an undisturbed flight."""
    duration_s = 1.0 + np.ceil(2.1 * quota / burst) / FRAMES_PER_S
    logs = folder / "logs"
    logs.mkdir()
    plant, url = start_plant(logs, folder / "flight", "--duration", str(duration_s))
    with FuzzingRelay(url, burst=burst, quota=quota, seed=seed) as relay:
        autopilot = Process(logs, "autopilot", "--plant", relay.url)
        with running(plant, autopilot):
            processes = {"plant": plant, "autopilot": autopilot}
            wait_for(lambda: _flown_s(plant) > 0.1 * duration_s, "a tenth of the flight", hours=1.0)
            before = _memory_mib(processes)
            wait_for(lambda: _flown_s(plant) > 0.95 * duration_s, "most of the flight", hours=1.0)
            after = _memory_mib(processes)
            lost = _kernel_drops([process.process.pid for process in processes.values()])
            codes = [plant.wait()]
            autopilot.process.send_signal(signal.SIGINT)
            codes.append(autopilot.wait())
    growth = {name: after[name] - before[name] for name in processes}
    failures = [f"{name} said: {process.errors()}" for name, process in processes.items() if process.errors()]
    failures += [f"exit codes {codes}"] * (codes != [0, 130])
    failures += [f"the {name} grew by {mib:.1f} MiB" for name, mib in growth.items() if mib > MOST_GROWTH_MIB]
    failures += ["not all was sent"] * (set(relay.sent.values()) != {quota})
    failures += ["the trajectory differs"] * (_hash(folder / "flight") != _undisturbed(folder, duration_s))
    return Outcome(relay.sent, lost, growth, failures)


def _flown_s(plant: Process) -> float:
    progress = plant.events("progress")
    ended = plant.events("ended")
    return float((ended or progress or [{"sim_time_s": 0.0}])[-1]["sim_time_s"])


def _memory_mib(processes: dict[str, Process]) -> dict[str, float]:
    return {name: psutil.Process(process.process.pid).memory_info().rss / 2**20 for name, process in processes.items()}


def _kernel_drops(pids: list[int]) -> int:
    """Sum the last column of /proc/net/udp over the sockets of some processes; 0 where there is no such file."""
    table = Path("/proc/net/udp")
    ports = {connection.laddr.port for pid in pids for connection in psutil.Process(pid).net_connections("udp4")}
    if not table.exists():
        return 0
    rows = [line.split() for line in table.read_text(encoding="utf-8").splitlines()[1:]]
    return sum(int(row[-1]) for row in rows if int(row[1].split(":")[1], 16) in ports)


def _undisturbed(folder: Path, duration_s: float) -> str:
    fly(folder / "undisturbed", "spiral", "--link", "memory", "--duration", str(duration_s))
    return _hash(folder / "undisturbed")


def _hash(out: Path) -> str:
    return sha256(states(out).tobytes()).hexdigest()
