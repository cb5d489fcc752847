"""Flights by command lines, with report and rows."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from colibri.analysis.logs import read_series
from colibri.cli.main import main
from colibri.common.types import Array
from colibri.mavlink.ulog.flight_topics import TRUTH, Topic
from colibri.mavlink.ulog.reader import FILE, FlightFile
from tools.harness.observer import Observer

GIVE_UP_AFTER_S = 60.0
THESIS_PLANT = (
    *("--vehicle", "hummingbird-thesis"),
    *("--integrator", "adaptive"),
    *("--start", "y=-1,z=0,psi=90,rotors=3000"),
)
"""Options by which `colibri plant` begins as profile `thesis` does."""


def fly(out: Path, *options: str, lost: bool = False) -> dict[str, Any]:
    try:
        code: int | str | None = main(["fly", *options, "--quiet", "--no-figures", "--out", str(out)])
    except SystemExit as ended:
        code = ended.code
    assert code == int(lost)
    figures: dict[str, Any] = json.loads((out / "report.json").read_text(encoding="utf-8"))
    return figures


def fly_thesis(out: Path, *options: str, lost: bool = False) -> dict[str, Any]:
    return fly(out, *options, "--profile", "thesis", lost=lost)


def topic_rows(log: Path, topic: Topic = TRUTH) -> dict[str, Array]:
    """Read a topic of a log, or of a flight's folder, as columns."""
    flown = FlightFile(log / FILE if log.is_dir() else log)
    return dict(zip(topic.names, read_series(flown, topic, *topic.names), strict=True))


def wait_for(condition: Callable[[], object], what: str, within_s: float = GIVE_UP_AFTER_S) -> None:
    """Wait; the bound is never part of a verdict."""
    give_up_s = monotonic() + within_s
    while not condition():
        assert monotonic() < give_up_s, f"waited in vain for {what}"
        sleep(0.01)


class Process:
    """`colibri plant` or `colibri autopilot` as a user starts it."""

    def __init__(self, folder: Path, package: str, *options: str) -> None:
        self._said = folder / f"{package}-{len(list(folder.iterdir()))}.jsonl"
        self._errors = self._said.with_suffix(".err")
        with self._said.open("wb") as said, self._errors.open("wb") as errors:
            command = [sys.executable, "-P", "-m", f"colibri.{package}", "--json", "--parent", str(os.getpid())]
            self.process = subprocess.Popen([*command, *options], stdout=said, stderr=errors, process_group=0)

    def events(self, name: str) -> list[dict[str, Any]]:
        lines = self._said.read_text(encoding="utf-8").split("\n")[:-1]
        return [event for event in map(json.loads, lines) if event["event"] == name]

    def wait_for(self, name: str) -> dict[str, Any]:
        wait_for(lambda: self.events(name) or self.process.poll() is not None, f"{name} in {self._said.name}")
        events = self.events(name)
        assert events, f"ended without {name}: {self.errors()}"
        return events[-1]

    def errors(self) -> str:
        return self._errors.read_text(encoding="utf-8")

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def wait(self) -> int:
        return self.process.wait(GIVE_UP_AFTER_S)


@contextmanager
def running(*processes: Process) -> Iterator[None]:
    try:
        yield
    finally:
        for process in processes:
            process.kill()


def start_plant(folder: Path, out: Path, *options: str) -> tuple[Process, str]:
    plant = Process(folder, "plant", "--link", "udpin:127.0.0.1:0", "--out", str(out), *THESIS_PLANT, *options)
    url: str = plant.wait_for("listening")["url"]
    return plant, url.replace("udpin", "udpout")


def start_autopilot(folder: Path, url: str, *options: str) -> Process:
    return Process(folder, "autopilot", "--plant", url, "--profile", "thesis", *options)


def states(out: Path) -> Array:
    return np.stack(list(topic_rows(out).values())[:14], axis=1)


WAITING = "udpin:127.0.0.1:0"
_WAITS = re.compile(r"waits for ground stations on 127\.0\.0\.1:(\d+) \((udpin|tcpin)\)")
_GRACE_S = 10.0
_COMPILES_S = 180.0  # the first start after a change compiles


@dataclass(frozen=True, slots=True)
class SitlProcess:
    process: subprocess.Popen[bytes]
    seen: Observer
    state: Path
    _said: Path
    _printed: Path

    @property
    def ports(self) -> list[int]:
        return [int(port) for port, _ in _WAITS.findall(self.said)]

    @property
    def port(self) -> int:
        return self.ports[0]

    @property
    def said(self) -> str:
        return self._said.read_text(encoding="utf-8")

    @property
    def printed(self) -> list[str]:
        return self._printed.read_text(encoding="utf-8").splitlines()

    def end(self) -> int:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise


@contextmanager
def vehicle(
    folder: Path, *options: str, links: tuple[str, ...] = (WAITING,), speed: float = 1.0
) -> Iterator[SitlProcess]:
    """Run `colibri sitl` within a block, ready to be armed, with its files in `folder`."""
    said, printed, state = folder / "sitl.err", folder / "sitl.out", folder / "state"
    with Observer() as seen, said.open("wb") as errors, printed.open("wb") as output:
        command = [
            *(sys.executable, "-m", "colibri", "sitl", "--plant-port", "0", "--speed", repr(speed)),
            *("--state", str(state)),
            *(f"--gcs={url}" for url in (*links, seen.url)),
            *options,
        ]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=errors)
        flown = SitlProcess(process, seen, state, said, printed)
        try:
            wait_for(lambda: seen.sights or process.poll() is not None, "the vehicle's first word", _COMPILES_S)
            waits = sum(url.startswith(("udpin:127.0.0.1", "tcpin:127.0.0.1")) for url in links)
            wait_for(lambda: len(flown.ports) >= waits or process.poll() is not None, "its ports")
            assert process.poll() is None, flown.said
            yield flown
        finally:
            flown.end()
