"""Flights of two real processes under fire, and campaigns by seed."""

import random
import signal
import tempfile
from collections.abc import Mapping
from contextlib import closing
from math import ceil
from pathlib import Path
from time import monotonic, perf_counter, sleep
from typing import NamedTuple, TypeAlias

import psutil

from colibri.mavlink.files.folder import Folder
from colibri.mavlink.wire.dialect import Codec
from tools.fuzz.datagrams import ACTUATORS, ATTITUDE, AUTOPILOT, FRAME_US, PLANT, Fuzzer
from tools.fuzz.vehicle import ground_campaign
from tools.harness.ports import Relay
from tools.harness.processes import Process, fly_thesis, running, start_autopilot, start_plant, states

UNREADABLE = ("malformed", "unknown", "truncated")  # counts of a codec that depend on the datagram alone


class FuzzingRelay(Relay):
    """A relay that sends a burst with the first datagram of each moment: at most two wait in a receiver."""

    def __init__(self, plant_url: str, *, burst: int, quota: int, seed: int) -> None:
        super().__init__(plant_url)
        self._chance = random.Random(seed)
        self._fuzzers = {
            "plant": Fuzzer(self._chance, AUTOPILOT, PLANT),
            "autopilot": Fuzzer(self._chance, PLANT, AUTOPILOT),
        }
        self.twins = {"plant": Codec(*PLANT), "autopilot": Codec(*AUTOPILOT)}
        self._burst = burst
        self._quota = quota
        self._moments_us = dict.fromkeys(self._fuzzers, 0)
        self.sent = {(to, kind): 0 for to in self._fuzzers for kind in ("random", "hostile")}

    def pass_on(self, to: str, datagram: bytes) -> None:
        moment_us = _moment_us(datagram)
        datagrams = []
        if moment_us > self._moments_us[to]:
            self._moments_us[to] = moment_us
            datagrams = self._bad(to, moment_us, datagram)
        datagrams.insert(self._chance.randint(0, len(datagrams)), datagram)
        for each in datagrams:
            self.deliver(to, each)

    def _bad(self, to: str, moment_us: int, good: bytes) -> list[bytes]:
        fuzzer, datagrams = self._fuzzers[to], []
        fuzzer.moment_us, fuzzer.good = moment_us, good
        for number in range(self._burst):
            kind = "hostile" if number % 2 else "random"
            if self.sent[to, kind] < self._quota:
                self.sent[to, kind] += 1
                datagrams.append(fuzzer.hostile() if kind == "hostile" else fuzzer.random())
                self.twins[to].decode(datagrams[-1])
        return datagrams


def _unreadable(dropped: Mapping[str, int]) -> dict[str, int]:
    return {reason: dropped.get(reason, 0) for reason in UNREADABLE}


def _moment_us(datagram: bytes) -> int:
    message_id = int.from_bytes(datagram[7:10], "little")
    if message_id == ACTUATORS:
        return int.from_bytes(datagram[10:18], "little")
    if message_id == ATTITUDE:
        return int.from_bytes(datagram[10:14], "little") * 1000
    return 0


MAX_GROWTH_MIB = 4.0
_MARGIN = 1.05
_STALLED_AFTER_S = 60.0
_LOOK_EVERY_S = 0.1
_EXIT_CODES = {"plant": 0, "autopilot": 130}


class FuzzOutcome(NamedTuple):
    sent: dict[tuple[str, str], int]  # bad datagrams by receiver and kind
    lost: int  # dropped by the kernel, because a receiver was too slow
    memory_mib: dict[str, tuple[float, float]]  # after a tenth of the flight and at its end
    failures: list[str]


def campaign(folder: Path, quota: int, *, burst: int, seed: int) -> FuzzOutcome:
    """Fly until each process was sent `quota` datagrams of each kind, a `burst` with each good one, and compare."""
    duration_s = (10 + ceil(_MARGIN * 2 * quota / burst)) * FRAME_US / 1e6
    logs = folder / "logs"
    logs.mkdir()
    plant, url = start_plant(logs, folder / "flight", "--duration", str(duration_s))
    with FuzzingRelay(url, burst=burst, quota=quota, seed=seed) as relay:
        autopilot = start_autopilot(logs, relay.url)
        processes = {"plant": plant, "autopilot": autopilot}
        with running(*processes.values()):
            failures = _fly_to(0.1 * duration_s, processes)
            before = _memory_mib(processes)
            failures = failures or _fly_to(0.98 * duration_s, processes)
            after = _memory_mib(processes)
            lost = _kernel_drops(processes)
            failures += _end(processes) if not failures else []
    if not failures:
        failures += _miscounted(processes, relay)
        fly_thesis(folder / "undisturbed", "spiral", "--link", "memory", "--duration", str(duration_s))
        flown, undisturbed = (states(folder / name).tobytes() for name in ("flight", "undisturbed"))
        failures += ["the trajectory differs"] * (flown != undisturbed)
    failures += ["not all was sent"] * (set(relay.sent.values()) != {quota})
    failures += [f"{name} said: {process.errors()}" for name, process in processes.items() if process.errors()]
    memory = {name: (before[name], after[name]) for name in processes}
    failures += [f"the {name} grew" for name, (was, now) in memory.items() if now - was > MAX_GROWTH_MIB]
    return FuzzOutcome(relay.sent, lost, memory, failures)


def _fly_to(time_s: float, processes: dict[str, Process]) -> list[str]:
    """Return the failure of a flight that ends or stalls early."""
    flown_s, moved_at_s = -1.0, monotonic()
    while flown_s < time_s:
        sleep(_LOOK_EVERY_S)
        plant = processes["plant"]
        said = plant.events("ended") or plant.events("progress") or [{"sim_time_s": 0.0}]
        now_s = float(said[-1]["sim_time_s"])
        if now_s > flown_s:
            flown_s, moved_at_s = now_s, monotonic()
        codes = {name: process.process.poll() for name, process in processes.items()}
        if flown_s < time_s and any(code is not None for code in codes.values()):
            return [f"ended in mid-flight: exit codes {codes}"]
        if monotonic() - moved_at_s > _STALLED_AFTER_S:
            return [f"the flight stands at t = {flown_s:.1f} s"]
    return []


def _end(processes: dict[str, Process]) -> list[str]:
    codes = {"plant": processes["plant"].wait()}
    processes["autopilot"].process.send_signal(signal.SIGINT)
    codes["autopilot"] = processes["autopilot"].wait()
    return [] if codes == _EXIT_CODES else [f"exit codes {codes}"]


def _miscounted(processes: dict[str, Process], relay: FuzzingRelay) -> list[str]:
    """Compare unreadable datagrams sent and counted."""
    failures = []
    for name, process in processes.items():
        counted, sent = map(_unreadable, (process.events("ended")[-1]["dropped"], relay.twins[name].dropped))
        if counted != sent:
            failures.append(f"the {name} counted {counted}, not {sent}")
    return failures


def _memory_mib(processes: dict[str, Process]) -> dict[str, float]:
    alive = {name: it.process.poll() is None for name, it in processes.items()}
    return {
        name: psutil.Process(it.process.pid).memory_info().rss / 2**20 if alive[name] else 0.0
        for name, it in processes.items()
    }


def _kernel_drops(processes: dict[str, Process]) -> int:
    """Sum the last column of /proc/net/udp over the processes' sockets."""
    table = Path("/proc/net/udp")
    alive = [psutil.Process(process.process.pid) for process in processes.values() if process.process.poll() is None]
    ports = {connection.laddr.port for process in alive for connection in process.net_connections("udp4")}
    if not table.exists():
        return 0
    rows = [line.split() for line in table.read_text(encoding="utf-8").splitlines()[1:]]
    return sum(int(row[-1]) for row in rows if int(row[1].split(":")[1], 16) in ports)


BURST = 60


class Job(NamedTuple):
    """A campaign from the peer or from ground stations."""

    seed: int
    datagrams: int  # of each kind, to each process; 0: messages instead
    messages: int  # from ground stations


_Reached: TypeAlias = tuple[str, list[tuple[float, float]], list[str]]
"""What was reached, memory in MiB before and after of each process, and failures."""


def fire(job: Job) -> tuple[str, list[str]]:
    """Return what was reached, and failures."""
    began_s = perf_counter()
    whom, run = ("lockstep", _lockstep) if job.datagrams else ("ground stations", _ground)
    with tempfile.TemporaryDirectory() as name:
        reached, memory_mib, failures = run(job, Path(name))
    grown = ", ".join(f"{before:.2f} to {after:.2f} MiB" for before, after in memory_mib)
    said = f"seed {job.seed}, {whom}: {'FAILED' if failures else reached}, {grown}, {perf_counter() - began_s:.0f} s"
    return said, [f"seed {job.seed}, {whom}: {failure}" for failure in failures]


def _lockstep(job: Job, folder: Path) -> _Reached:
    outcome = campaign(folder, job.datagrams, burst=BURST, seed=job.seed)
    failures = outcome.failures + [f"{outcome.lost} datagrams never arrived"] * (outcome.lost > 0)
    return f"{sum(outcome.sent.values())} sent, the flight is unchanged", [*outcome.memory_mib.values()], failures


def _ground(job: Job, path: Path) -> _Reached:
    with closing(Folder(path)) as folder:
        outcome = ground_campaign(job.messages, seed=job.seed, files=folder)
    accepted = f"{sum(outcome.sent.values())} sent, {outcome.accepted} commands of {outcome.kinds} kinds accepted"
    reached = f"{accepted}, {len(outcome.sent)} states met, {outcome.flown_s:.0f} s flown"
    return reached, [outcome.memory_mib], outcome.failures
