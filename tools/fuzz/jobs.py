"""Fuzzing campaigns by seed."""

import tempfile
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from colibri.mavlink.files.folder import Folder
from tools.fuzz.campaign import campaign
from tools.fuzz.ground import ground_campaign

BURST = 60
HEADER = f"{'fired at':<16}{'seed':>6}{'sent':>10}{'MiB before':>12}{'after':>9}{'s':>7}  reached"


class Job(NamedTuple):
    """A campaign with one seed, from the peer or from ground stations."""

    seed: int
    datagrams: int  # of each kind, to each process; 0: messages instead
    messages: int  # from ground stations


class JobResult(NamedTuple):
    lines: list[str]
    failures: list[str]


def fire(job: Job) -> JobResult:
    started_s = perf_counter()
    with tempfile.TemporaryDirectory() as name:
        return (_lockstep if job.datagrams else _ground)(job, Path(name), started_s)


def _lockstep(job: Job, folder: Path, started_s: float) -> JobResult:
    outcome = campaign(folder, job.datagrams, burst=BURST, seed=job.seed)
    failures = outcome.failures + [f"{outcome.lost} datagrams never arrived"] * (outcome.lost > 0)
    lines = []
    for name, memory_mib in outcome.memory_mib.items():
        sent = sum(count for (whom, _), count in outcome.sent.items() if whom == name)
        lines.append(_line(name, job.seed, sent, memory_mib, started_s, "the flight is unchanged", failures))
    return JobResult(lines, [f"seed {job.seed}, lockstep: {failure}" for failure in failures])


def _ground(job: Job, path: Path, started_s: float) -> JobResult:
    folder = Folder(path)
    outcome = ground_campaign(job.messages, seed=job.seed, files=folder)
    folder.close()
    reached = (
        f"{outcome.accepted} commands of {outcome.kinds} kinds accepted, {len(outcome.sent)} states met, "
        f"{outcome.flown_s:.0f} s flown"
    )
    sent = sum(outcome.sent.values())
    line = _line("ground stations", job.seed, sent, outcome.memory_mib, started_s, reached, outcome.failures)
    return JobResult([line], [f"seed {job.seed}, ground stations: {failure}" for failure in outcome.failures])


def _line(
    name: str,
    seed: int,
    sent: int,
    memory_mib: tuple[float, float],
    started_s: float,
    reached: str,
    failures: list[str],
) -> str:
    before, after = memory_mib
    took_s = perf_counter() - started_s
    return (
        f"{name:<16}{seed:>6}{sent:>10}{before:>12.2f}{after:>9.2f}{took_s:>7.0f}  {'FAILED' if failures else reached}"
    )
